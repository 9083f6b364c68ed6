"""What knows no mechanics: errors, input checks, ranks, PETSc handles, signals, files, timing."""
