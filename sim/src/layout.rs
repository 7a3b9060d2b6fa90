//! Where servos of byte memory keep what: Feetech STS, and AX and MX with
//! Protocol 1.0.

use std::f64::consts::TAU;

/// The memory of one family.
#[derive(Debug)]
pub struct Layout {
    /// Bytes of memory.
    pub size: usize,
    /// First address that a restart clears.
    pub ram: usize,
    pub model: usize,
    pub id: usize,
    pub return_delay: usize,
    pub status_level: usize,
    pub lowest: usize,
    pub highest: usize,
    pub hottest: usize,
    pub max_voltage: usize,
    pub min_voltage: usize,
    /// Proportional gain; `None` where it is not simulated (AX).
    pub p_gain: Option<usize>,
    pub offset: Option<usize>,
    pub torque: usize,
    pub goal: usize,
    pub goal_speed: usize,
    pub torque_limit: usize,
    pub position: usize,
    pub speed: usize,
    pub load: usize,
    pub voltage: usize,
    pub temperature: usize,
    pub status: Option<usize>,
    pub moving: usize,
    pub current: Option<usize>,
    /// What may be written: the addresses from the id up to the present values ...
    pub last_writable: usize,
    /// ... and these.
    pub also_writable: &'static [usize],
    /// Factory settings: address, bytes, value.
    pub factory: &'static [(usize, usize, u16)],
    /// Radians a tick.
    pub tick_rad: f64,
    /// Ticks a second in one unit of speed.
    pub speed_ticks_s: f64,
    /// The bit that is the sign of speed and position.
    pub sign_bit: u32,
    /// The bits that can shut the servo down: voltage, heat, overload.
    pub conditions: (u8, u8, u8),
    /// Which condition shuts down; 0: all of them.
    pub shutdown: Option<usize>,
    /// A goal beyond the limits is refused; otherwise it is moved to the limit.
    pub refuses_goals: bool,
    /// Instructions that it knows besides those that all know.
    pub sync_read: bool,
    pub bulk_read: bool,
    pub reboots: bool,
}

/// Feetech STS3215.
pub const STS: Layout = Layout {
    size: 86,
    ram: 40,
    model: 3,
    id: 5,
    return_delay: 7,
    status_level: 8,
    lowest: 9,
    highest: 11,
    hottest: 13,
    max_voltage: 14,
    min_voltage: 15,
    p_gain: Some(21),
    offset: Some(31),
    torque: 40,
    goal: 42,
    goal_speed: 46,
    torque_limit: 48,
    position: 56,
    speed: 58,
    load: 60,
    voltage: 62,
    temperature: 63,
    status: Some(65),
    moving: 66,
    current: Some(69),
    last_writable: 55,
    also_writable: &[],
    factory: &[
        (0, 2, 3 | 10 << 8),
        (7, 1, 250),
        (8, 1, 1),
        (11, 2, 4095),
        (13, 1, 70),
        (14, 1, 140),
        (15, 1, 40),
        (16, 2, 1000),
        (21, 1, 32),
        (22, 1, 32),
        (28, 2, 310),
        (48, 2, 1000),
        (55, 1, 1),
    ],
    tick_rad: TAU / 4096.0,
    speed_ticks_s: 1.0,
    sign_bit: 15,
    conditions: (1, 1 << 2, 1 << 5),
    shutdown: None,
    refuses_goals: false,
    sync_read: true,
    bulk_read: false,
    reboots: true,
};

/// AX-12A and AX-18A: 1024 ticks over 300 degrees.
pub const AX: Layout = Layout {
    size: 50,
    ram: 24,
    model: 0,
    id: 3,
    return_delay: 5,
    status_level: 16,
    lowest: 6,
    highest: 8,
    hottest: 11,
    max_voltage: 13,
    min_voltage: 12,
    p_gain: None,
    offset: None,
    torque: 24,
    goal: 30,
    goal_speed: 32,
    torque_limit: 34,
    position: 36,
    speed: 38,
    load: 40,
    voltage: 42,
    temperature: 43,
    status: None,
    moving: 46,
    current: None,
    last_writable: 35,
    also_writable: &[44, 47, 48, 49],
    factory: &[
        (2, 1, 24),
        (4, 1, 1),
        (5, 1, 250),
        (8, 2, 1023),
        (11, 1, 70),
        (12, 1, 60),
        (13, 1, 140),
        (14, 2, 1023),
        (16, 1, 2),
        (17, 1, 36),
        (18, 1, 36),
        (26, 1, 1),
        (27, 1, 1),
        (28, 1, 32),
        (29, 1, 32),
        (34, 2, 1023),
        (48, 2, 32),
    ],
    tick_rad: TAU * 300.0 / 360.0 / 1024.0,
    // 0.111 revolutions a minute.
    speed_ticks_s: 0.111 * TAU / 60.0 / (TAU * 300.0 / 360.0 / 1024.0),
    sign_bit: 10,
    conditions: (1, 1 << 2, 1 << 5),
    shutdown: Some(18),
    refuses_goals: true,
    sync_read: false,
    bulk_read: false,
    reboots: false,
};

/// MX-28, MX-64 and MX-106 with Protocol 1.0.
pub const MX1: Layout = Layout {
    size: 74,
    p_gain: Some(28),
    also_writable: &[44, 47, 48, 49, 70, 71, 72, 73],
    factory: &[
        (2, 1, 36),
        (4, 1, 34),
        (5, 1, 250),
        (8, 2, 4095),
        (11, 1, 80),
        (12, 1, 60),
        (13, 1, 160),
        (14, 2, 1023),
        (16, 1, 2),
        (17, 1, 36),
        (18, 1, 36),
        (28, 1, 32),
        (34, 2, 1023),
    ],
    tick_rad: TAU / 4096.0,
    // 0.114 revolutions a minute.
    speed_ticks_s: 0.114 * 4096.0 / 60.0,
    bulk_read: true,
    ..AX
};
