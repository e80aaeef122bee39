//! What the mesher's program reads; the program itself is `main.rs`.

#![deny(missing_docs)]

pub mod case_file;
