//! What answers were computed on: a result that others cannot place is worth little.

/// The build and the processor.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Machine {
    /// Architecture and system the program was compiled for, such as `x86_64-linux`.
    pub target: String,
    /// Instruction sets that the compiler was allowed to use anywhere, of those that matter here.
    pub compiled_features: Vec<&'static str>,
    /// Instruction sets that the processor has, of those that matter here.
    pub cpu_features: Vec<&'static str>,
    /// Whether debug assertions are on.
    pub debug_assertions: bool,
    /// Threads that work is shared among.
    pub threads: usize,
    /// Whether the processor keeps numbers too small for the normal range, tried on the spot.
    pub keeps_subnormals: bool,
}

macro_rules! features {
    ($detect:ident: $($name:tt),+) => {{
        let mut compiled = Vec::new();
        let mut present = Vec::new();
        $(
            if cfg!(target_feature = $name) {
                compiled.push($name);
            }
            if std::arch::$detect!($name) {
                present.push($name);
            }
        )+
        (compiled, present)
    }};
}

impl Machine {
    /// This build on this machine.
    pub fn this() -> Self {
        #[cfg(target_arch = "x86_64")]
        let (compiled_features, cpu_features) =
            features!(is_x86_feature_detected: "sse2", "sse4.1", "avx", "avx2", "fma", "avx512f", "avx512vl");
        #[cfg(target_arch = "aarch64")]
        let (compiled_features, cpu_features) = features!(is_aarch64_feature_detected: "neon", "sve");
        #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
        let (compiled_features, cpu_features) = (Vec::new(), Vec::new());
        Self {
            target: format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
            compiled_features,
            cpu_features,
            debug_assertions: cfg!(debug_assertions),
            threads: rayon::current_num_threads(),
            keeps_subnormals: keeps_subnormals(),
        }
    }
}

/// Whether half of the smallest normal number is more than 0, when it comes out of a sum and when it goes into one.
fn keeps_subnormals() -> bool {
    let smallest = std::hint::black_box(f32::MIN_POSITIVE);
    let half = std::hint::black_box(smallest * 0.5);
    half > 0.0 && std::hint::black_box(half + half) == smallest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_compiled_in_is_there() {
        let machine = Machine::this();
        assert!(machine.compiled_features.iter().all(|feature| machine.cpu_features.contains(feature)), "{machine:?}");
        assert!(machine.keeps_subnormals && machine.threads > 0);
        #[cfg(target_arch = "x86_64")]
        assert!(machine.compiled_features.contains(&"sse2"));
    }
}
