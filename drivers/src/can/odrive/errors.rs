//! The error word of an ODrive controller in words.

/// Error of a controller whose watchdog has expired.
pub(super) const LOST: &str = "watchdog expired";

/// The names of the bits of an error word; `None` without errors.
pub(super) fn error_names(errors: u32) -> Option<String> {
    const NAMES: [(u32, &str); 22] = [
        (0, "initializing"),
        (1, "system level"),
        (2, "timing error"),
        (3, "missing estimate"),
        (4, "bad configuration"),
        (5, "driver fault"),
        (6, "missing input"),
        (8, "over-voltage"),
        (9, "under-voltage"),
        (10, "over-current of the supply"),
        (11, "too much regeneration current"),
        (12, "current limit violation"),
        (13, "motor overheating"),
        (14, "inverter overheating"),
        (15, "velocity limit violation"),
        (16, "position limit violation"),
        (24, LOST),
        (25, "emergency stop requested"),
        (26, "spinout"),
        (27, "brake resistor disarmed"),
        (28, "thermistor disconnected"),
        (30, "calibration error"),
    ];
    if errors == 0 {
        return None;
    }
    let set = NAMES.iter().filter(|(bit, _)| errors >> bit & 1 == 1);
    let names: Vec<&str> = set.map(|(_, name)| *name).collect();
    Some(format!("{} (error {errors:08X})", names.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_named_with_their_number() {
        assert_eq!(
            error_names(1 << 24 | 1 << 13).as_deref(),
            Some("motor overheating, watchdog expired (error 01002000)")
        );
        assert_eq!(error_names(0), None);
    }
}
