; Generated from the tables by `cargo xtask docs`; do not edit.

[
  (macro_definition)
  (repetition)
  (counted_loop)
  (conditional)
] @fold
