//! What is made of an assembled program: images, listings, source again; and what its names stand for.

pub mod disasm;
pub mod format;
pub mod image;
pub mod listing;
pub mod names;
