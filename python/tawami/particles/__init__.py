"""Material laws, which particle has which, and the cell and rank each particle belongs to."""
