//! Instruction sets, chosen at run time, and loops compiled for each of them.
//!
//! A loop over arrays becomes vectors wherever a processor has them, without a word about vectors in it, if it is compiled for
//! what the processor has. No operation is fused or reordered: every set gives the same bits.
#![allow(unsafe_code)]

use std::sync::OnceLock;

/// The environment variable that forces an instruction set: `portable`, `avx2` or `avx512`.
pub const VARIABLE: &str = "WHITTED_SIMD";

/// An instruction set that this processor has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Level(Set);

/// An instruction set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Set {
    /// What any processor has.
    Portable,
    /// AVX2, BMI1 and POPCNT.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 F, VL and DQ besides.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

/// Work whose loops are to be vectors.
pub trait Task {
    /// What comes of it.
    type Output;

    /// Does it. To be inlined always, and so all that its loops call. Loops over several arrays had better be in a function that has
    /// these as arguments, those that are written apart from those that are read: of references in a struct, and of arrays in one that is
    /// written, compilers do not know what overlaps.
    fn run(self) -> Self::Output;
}

impl Level {
    /// What any processor can do.
    pub const PORTABLE: Self = Self(Set::Portable);

    /// Every set that this processor has, the best last.
    pub fn available() -> impl Iterator<Item = Self> {
        let sets = [
            Some(Set::Portable),
            #[cfg(target_arch = "x86_64")]
            (is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("popcnt"))
            .then_some(Set::Avx2),
            #[cfg(target_arch = "x86_64")]
            (is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("popcnt"))
            .then_some(Set::Avx512),
        ];
        sets.into_iter().flatten().map(Self)
    }

    /// The set named by [`VARIABLE`] if this processor has it, else the best. Looked up once.
    pub fn chosen() -> Self {
        static CHOSEN: OnceLock<Level> = OnceLock::new();
        *CHOSEN.get_or_init(|| {
            let wanted = std::env::var(VARIABLE).unwrap_or_default();
            let named = Self::available().find(|level| level.name() == wanted);
            named.or(Self::available().last()).unwrap_or(Self::PORTABLE)
        })
    }

    /// What [`VARIABLE`] asks for, if this processor does not have it.
    pub fn refused() -> Option<String> {
        let wanted = std::env::var_os(VARIABLE)?.to_string_lossy().into_owned();
        let is_known = Self::available().any(|level| level.name() == wanted);
        (!wanted.is_empty() && !is_known).then_some(wanted)
    }

    /// What the set is called in reports and in [`VARIABLE`].
    pub fn name(self) -> &'static str {
        match self.0 {
            Set::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => "avx512",
        }
    }

    /// The set, one that the processor has.
    #[inline(always)]
    pub(crate) fn set(self) -> Set {
        self.0
    }

    /// Does some work compiled for the set.
    #[inline(always)]
    pub fn run<T: Task>(self, task: T) -> T::Output {
        match self.0 {
            Set::Portable => run_portable(task),
            // SAFETY: a level is only ever one that the processor has.
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => unsafe { run_avx2(task) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => unsafe { run_avx512(task) },
        }
    }
}

#[inline(never)]
fn run_portable<T: Task>(task: T) -> T::Output {
    task.run()
}

#[cfg(target_arch = "x86_64")]
#[inline(never)]
#[target_feature(enable = "avx2,bmi1,popcnt")]
fn run_avx2<T: Task>(task: T) -> T::Output {
    task.run()
}

#[cfg(target_arch = "x86_64")]
#[inline(never)]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,bmi1,popcnt")]
fn run_avx512<T: Task>(task: T) -> T::Output {
    task.run()
}
