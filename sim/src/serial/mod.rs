//! The far end of a serial line: the host's port, the servos' packets.

pub(crate) mod build;
pub(crate) mod host_port;
pub(crate) mod imu_board;
pub(crate) mod protocol1_line;
pub(crate) mod protocol2_line;
pub(crate) mod protocol2_packet;
pub(crate) mod serial_line;
pub(crate) mod server;
