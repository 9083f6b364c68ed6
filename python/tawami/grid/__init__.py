"""The background grid: cells, edges and one-dimensional bases, before there are any particles."""
