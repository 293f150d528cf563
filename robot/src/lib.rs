//! The host of the three-processor robot controller.

pub mod dynamics;
pub mod packet;
pub mod plant;
