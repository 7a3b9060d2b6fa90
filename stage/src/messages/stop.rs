//! The emergency stop of a whole stage.

use super::codec::{ByteReader, Field, message_struct};
use super::error::MessageError;

message_struct! {
/// Torque off on every follower, now; sent again until all say that it is off.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StageStop {
    /// Instance of the leader.
    pub instance: u64,
    /// Number of the stop, one more for each: a follower obeys each once.
    pub number: u64,
}
}
