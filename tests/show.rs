//! A show: requests rain in and the servos keep every limit; nobody without
//! the token gets anything; floods and slow viewers disturb nobody.

mod export;
#[cfg(feature = "view")]
mod flood;
mod meshes;
mod requests;
#[cfg(feature = "view")]
mod server;
#[cfg(feature = "view")]
mod watched;
