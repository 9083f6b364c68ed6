"""What the cases share: program, tables, figures and finite elements."""
