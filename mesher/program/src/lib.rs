//! What the mesher's program reads; the program itself is `main.rs`.

pub mod case_file;
