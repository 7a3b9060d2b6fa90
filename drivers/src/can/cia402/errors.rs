//! Error and abort codes of CiA 402 drives in words.

/// Error of a drive that misses our heartbeat.
pub(super) const LOST: &str = "heartbeat lost";

/// The name of the code with which a drive refuses an SDO.
pub(super) fn abort_name(code: u32) -> String {
    let name = match code {
        0x0601_0000 => "unsupported access",
        0x0601_0002 => "read only",
        0x0602_0000 => "no such object",
        0x0604_0041 => "cannot be mapped",
        0x0607_0010 => "wrong length",
        0x0609_0011 => "no such subindex",
        0x0609_0030 => "value out of range",
        0x0800_0022 => "not in this state",
        _ => "abort",
    };
    format!("{name} ({code:08X})")
}

/// The error classes of CiA 402.
pub(super) fn error_name(code: u16) -> String {
    let name = match code {
        0x2000..=0x2FFF => "over-current",
        0x3100..=0x31FF => "supply voltage",
        0x3210..=0x321F => "over-voltage",
        0x3220..=0x322F => "under-voltage",
        0x4000..=0x4FFF => "overheating",
        0x5000..=0x5FFF => "hardware",
        0x6000..=0x6FFF => "software",
        0x7121 => "motor blocked",
        0x7300..=0x73FF => "sensor",
        0x8130 => LOST,
        0x8611 => "following error",
        _ => "error",
    };
    format!("{name} (code {code:04X})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_named() {
        assert_eq!(error_name(0x8130), "heartbeat lost (code 8130)");
        assert_eq!(abort_name(0x0602_0000), "no such object (06020000)");
    }
}
