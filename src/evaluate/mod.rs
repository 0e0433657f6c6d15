//! Outputs and labels -> honest numbers: confusion, Table 1, density, comparison.
