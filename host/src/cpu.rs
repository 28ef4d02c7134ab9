//! Whether this processor has the instructions that the programs were built for (x86-64-v3, see
//! `.cargo/config.toml`).

/// The first x86-64-v3 feature that this processor lacks; `None` when it has them all, or on other
/// architectures.
///
/// It asks CPUID itself: `is_x86_feature_detected!` answers from the build flags, which is what is
/// in question.
#[cfg(target_arch = "x86_64")]
pub fn missing_cpu_feature() -> Option<&'static str> {
    use std::arch::x86_64::{__cpuid, __cpuid_count};
    let leaf_1 = __cpuid(1).ecx;
    let leaf_7 = if __cpuid(0).eax >= 7 { __cpuid_count(7, 0).ebx } else { 0 };
    let extended = if __cpuid(0x8000_0000).eax >= 0x8000_0001 { __cpuid(0x8000_0001).ecx } else { 0 };
    missing(leaf_1, leaf_7, extended)
}

/// Other architectures build without the flag.
#[cfg(not(target_arch = "x86_64"))]
pub fn missing_cpu_feature() -> Option<&'static str> {
    None
}

#[cfg(any(target_arch = "x86_64", test))]
fn missing(leaf_1_ecx: u32, leaf_7_ebx: u32, extended_ecx: u32) -> Option<&'static str> {
    let features = [
        ("FMA", leaf_1_ecx, 12),
        ("MOVBE", leaf_1_ecx, 22),
        ("OSXSAVE", leaf_1_ecx, 27),
        ("AVX", leaf_1_ecx, 28),
        ("F16C", leaf_1_ecx, 29),
        ("BMI1", leaf_7_ebx, 3),
        ("AVX2", leaf_7_ebx, 5),
        ("BMI2", leaf_7_ebx, 8),
        ("LZCNT", extended_ecx, 5),
    ];
    features.into_iter().find(|(_, register, bit)| register >> bit & 1 == 0).map(|(name, _, _)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_missing_feature_is_named() {
        assert_eq!(missing(u32::MAX, u32::MAX, u32::MAX), None);
        assert_eq!(missing(u32::MAX, !(1 << 5), u32::MAX), Some("AVX2"));
        assert_eq!(missing(!(1 << 12), 0, 0), Some("FMA"));
        assert_eq!(missing(u32::MAX, u32::MAX, 0), Some("LZCNT"));
    }

    #[test]
    fn this_machine_runs_what_was_built_for_it() {
        assert_eq!(missing_cpu_feature(), None);
    }
}
