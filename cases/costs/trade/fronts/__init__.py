"""Ways to reduce the error at equal time: what each of them gains over the default."""
