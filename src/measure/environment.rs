//! What a measurement was made on.

use std::hint::black_box;

use crate::measure::machine::Machine;

/// The machine and the program, as far as the program can tell.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Environment {
    /// Version of this program.
    pub version: &'static str,
    /// The commit of the checkout that the program stands in when it measures, if there is one.
    pub commit: Option<String>,
    /// What was in `RUSTFLAGS` when it was compiled; null if that was not set.
    pub rustflags: Option<&'static str>,
    /// The build and the processor's instruction sets; its threads find exact answers, speed is that of one.
    #[serde(flatten)]
    pub machine: Machine,
    /// What the processor calls itself.
    pub cpu: String,
    /// Processors that the system offers.
    pub processors: usize,
    /// Whether results too small for a normal number become 0: tried.
    pub flush_to_zero: bool,
    /// Whether operands that are too small for a normal number count as 0: tried.
    pub denormals_are_zero: bool,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Environment {
    /// Looks around.
    pub fn detect(commit: Option<String>, seed: u64) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            commit,
            rustflags: option_env!("RUSTFLAGS"),
            machine: Machine::this(),
            cpu: cpu(),
            processors: std::thread::available_parallelism().map_or(1, usize::from),
            flush_to_zero: black_box(f32::MIN_POSITIVE) * black_box(0.5) == 0.0,
            // The smallest subnormal times 2^63 is normal: only its own flushing makes it 0.
            denormals_are_zero: black_box(f32::from_bits(1)) * black_box((1u64 << 63) as f32) == 0.0,
            seed,
        }
    }
}

/// The processor's name where the system has a file that says so.
fn cpu() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| {
        let (key, value) = line.split_once(':')?;
        (key.trim() == "model name").then(|| value.trim().to_owned())
    });
    name.unwrap_or_else(|| "unknown".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_state_of_subnormal_numbers_is_that_of_the_machine() {
        let here = Environment::detect(None, 1);
        assert_eq!(here.machine.keeps_subnormals, !here.flush_to_zero && !here.denormals_are_zero);
        assert!(here.processors > 0);
    }
}
