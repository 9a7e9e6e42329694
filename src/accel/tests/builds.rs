//! Builds end, in time and when told to, and describe themselves.

use std::sync::Arc;

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use glam::Vec3;

use super::meshes::{soup, sphere};
use crate::accel::{Kind, Params, Preset, TriangleAccelerator, dispatch_kind};
use crate::geometry::{Hit, PreparedRay, Ray, TriangleMesh};
use crate::progress::{Progress, Silent};

/// Builds, and fails where that takes unreasonably long or the tree is unreasonably deep.
fn build_in_time<A: TriangleAccelerator>(name: &str, mesh: &Arc<TriangleMesh>, preset: Preset) -> A {
    let start = Instant::now();
    let accelerator = A::build(mesh, &Params { preset, ..Params::default() }, &Silent).unwrap();
    let (took, stats) = (start.elapsed(), accelerator.stats());
    eprintln!("{name} {} {preset:?} {took:?} {stats:?}", A::NAME);
    assert!(took < Duration::from_secs(10), "{name}, {} {preset:?}: {took:?}", A::NAME);
    assert!(stats.max_depth <= 1000, "{name}, {} {preset:?}: {stats:?}", A::NAME);
    accelerator.validate().unwrap();
    accelerator
}

/// What makes builders that merge neighbours slow and deep: boxes that coincide, share their centre, or tie in a row.
#[test]
fn coincident_and_regular_triangles_build_quickly() {
    const COUNT: usize = 10_000;
    let triangle = [Vec3::new(0.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 1.0, 1.0)];
    let identical = soup(&vec![triangle; COUNT]);
    let shell = |i: usize| {
        let size = 1.001f32.powi(i as i32);
        [Vec3::new(-size, -size, 0.0), Vec3::new(size, -size, 0.0), Vec3::new(size, size, 0.0)]
    };
    let nested = soup(&(0..COUNT).map(shell).collect::<Vec<_>>());
    let strip = soup(&(0..COUNT).map(|i| triangle.map(|p| p + Vec3::X * i as f32)).collect::<Vec<_>>());
    let ray = PreparedRay::new(&Ray::new(Vec3::new(0.25, 0.25, 0.0), Vec3::Z)).unwrap();
    for &kind in &Kind::ALL[1..] {
        for &preset in Preset::ALL {
            dispatch_kind!(kind, A => {
                build_in_time::<A>("nested", &nested, preset);
                build_in_time::<A>("strip", &strip, preset);
                let accelerator: A = build_in_time("identical", &identical, preset);
                let mut best = Hit::MISS;
                accelerator.closest(&ray, 0, &mut best);
                assert_eq!((best.t, best.primitive), (1.0, 0));
                let mut next = Hit::MISS;
                accelerator.next_after(&ray, 0, best.key(), &mut next);
                assert_eq!((next.t, next.primitive), (1.0, 1));
            });
        }
    }
}

/// Counts steps and looks for cancellation, and cancels at the `stop`-th look.
struct Counted {
    steps: AtomicU64,
    reports: AtomicU64,
    looks: AtomicU64,
    stop: u64,
}

impl Counted {
    fn new(stop: u64) -> Self {
        Self { steps: AtomicU64::new(0), reports: AtomicU64::new(0), looks: AtomicU64::new(0), stop }
    }
}

impl Progress for Counted {
    fn advance(&self, steps: u64) {
        self.steps.fetch_add(steps, Ordering::Relaxed);
        self.reports.fetch_add(1, Ordering::Relaxed);
    }

    fn is_cancelled(&self) -> bool {
        self.looks.fetch_add(1, Ordering::Relaxed) + 1 >= self.stop
    }
}

#[test]
fn builds_report_every_triangle_once_and_stop_wherever_they_look() {
    let ball = sphere(20, 20);
    for &kind in Kind::ALL {
        for &preset in Preset::ALL {
            let params = Params { preset, ..Params::default() };
            dispatch_kind!(kind, A => {
                let whole = Counted::new(u64::MAX);
                A::build(&ball, &params, &whole).unwrap();
                assert_eq!(whole.steps.into_inner(), ball.live_count() as u64, "{} {preset:?}", A::NAME);
                let (looks, reports) = (whole.looks.into_inner(), whole.reports.into_inner());
                if kind != Kind::Linear {
                    // At least once a round of the optimiser, which has 16.
                    assert!(looks > 16 && reports > 10, "{} {preset:?}: {looks} looks, {reports} reports", A::NAME);
                }
                for stop in 1..=looks {
                    let stopped = Counted::new(stop);
                    assert!(A::build(&ball, &params, &stopped).is_err(), "{} {preset:?} {stop}", A::NAME);
                    assert_eq!(stopped.looks.into_inner(), stop, "work goes on after a cancellation");
                }
            });
        }
    }
}

#[test]
fn kinds_have_their_names() {
    for &kind in Kind::ALL {
        assert_eq!(dispatch_kind!(kind, A => A::NAME), kind.name());
        assert_eq!(serde_json::to_value(kind).unwrap(), kind.name());
    }
    assert!(Kind::ALL.contains(&Kind::Auto.resolve()));
}
