"""The only importer of dolfinx, basix and FFCx: elements, rules, kernels, the mesh of a grid."""
