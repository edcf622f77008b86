//! Loops with the widest instructions of this processor: wheels target the oldest x86-64, where they are up to four times slower.

/// `widest!(|fused| work)` runs the work, compiled for AVX2 too, where all functions that it calls are `#[inline(always)]`. Only where
/// `fused` is true is a fused multiply-add an instruction of the processor; what does not use it has the same bits everywhere.
macro_rules! widest {
    (|$fused:pat_param| $work:expr) => {
        $crate::linalg::widest::run(
            #[inline(always)]
            |$fused: bool| $work,
        )
    };
}
pub(crate) use widest;

pub fn run<R>(work: impl FnOnce(bool) -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: the processor has just been asked for both.
        return unsafe { avx2(work) };
    }
    work(false)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn avx2<R>(work: impl FnOnce(bool) -> R) -> R {
    work(true)
}
