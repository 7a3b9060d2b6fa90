//! Failpoints: a thread that panics, or work that is slow, at a named place. Tests
//! use them to see what follows (docs/crash-safety.md).
//!
//! Built in with the feature `failpoints`, which tests turn on and a release
//! build has not; then the variable `SERVODANCE_FAILPOINT` sets one:
//!
//! - `panic:PLACE@N`: the thread that passes PLACE for the Nth time panics.
//! - `slow:PLACE@MS`: each pass of PLACE takes so many milliseconds more.

/// A place in the program where a failpoint may strike.
pub fn pass(place: &str) {
    #[cfg(feature = "failpoints")]
    active::pass(place);
    #[cfg(not(feature = "failpoints"))]
    let _ = place;
}

/// A reader that passes a place at each read.
pub struct FailpointReader<R> {
    pub reader: R,
    pub place: &'static str,
}

impl<R: std::io::Read> std::io::Read for FailpointReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        pass(self.place);
        self.reader.read(buffer)
    }
}

#[cfg(feature = "failpoints")]
mod active {
    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::time::Duration;

    #[derive(Clone, Debug, PartialEq, Eq)]
    struct Failpoint {
        panics: bool,
        place: String,
        number: u64,
    }

    impl Failpoint {
        fn parse(text: &str) -> Option<Self> {
            let (action, rest) = text.split_once(':')?;
            let (place, number) = rest.split_once('@')?;
            Some(Self {
                panics: match action {
                    "panic" => true,
                    "slow" => false,
                    _ => return None,
                },
                place: place.to_owned(),
                number: number.parse().ok()?,
            })
        }
    }

    pub fn pass(place: &str) {
        static SET: OnceLock<Option<Failpoint>> = OnceLock::new();
        static PASSES: AtomicU64 = AtomicU64::new(0);
        let read = || Failpoint::parse(&std::env::var("SERVODANCE_FAILPOINT").ok()?);
        let Some(set) = SET.get_or_init(read) else {
            return;
        };
        if set.place != place {
            return;
        }
        if !set.panics {
            std::thread::sleep(Duration::from_millis(set.number));
        } else if PASSES.fetch_add(1, Ordering::Relaxed) + 1 == set.number {
            panic!("this is a drill");
        }
    }

    #[test]
    fn malformed_failpoints_do_nothing() {
        assert_eq!(Failpoint::parse("panic:model"), None);
        assert_eq!(Failpoint::parse("smile:model@3"), None);
        let set = Failpoint::parse("panic:model@3").unwrap();
        assert!(set.panics && set.place == "model" && set.number == 3);
    }
}
