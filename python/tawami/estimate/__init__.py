"""The error of a solution by dual-weighted residuals."""
