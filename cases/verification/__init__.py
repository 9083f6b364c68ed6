"""Cases that are compared with a closed form, a published result or finite elements."""
