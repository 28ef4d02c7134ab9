//! The supported arms: the one dispatch from numbers known at run time to the law's const generics.
//!
//! The second number is how many axes the law's vectors have; of the six [`TaskAxes`](super::TaskAxes)
//! says which are controlled. So one pair for each number of joints serves every subset; two joints in the
//! plane of x and y have one of their own besides, which is faster. Each costs the build what docs/design.md says.

/// Evaluates an expression with the numbers of joints and task axes as constants, or another one
/// for an arm that is not supported.
///
/// ```
/// fn name<const N: usize, const D: usize>() -> String {
///     format!("{N} joints, {D} axes")
/// }
/// let (joints, axes) = (6, 6);
/// let arm = admittance_core::with_arm!((joints, axes), <N, D> => Some(name::<N, D>()), else None);
/// assert_eq!(arm.as_deref(), Some("6 joints, 6 axes"));
/// ```
#[macro_export]
macro_rules! with_arm {
    (($joints:expr, $axes:expr), <$n:ident, $d:ident> => $then:expr, else $otherwise:expr) => {
        $crate::with_arm!(@each ($joints, $axes), $n, $d, $then, $otherwise, (2, 2), (2, 6), (3, 6), (4, 6), (5, 6), (6, 6), (7, 6), (8, 6))
    };
    (@each ($joints:expr, $axes:expr), $n:ident, $d:ident, $then:expr, $otherwise:expr, $(($joint_count:literal, $axis_count:literal)),+) => {
        match (usize::try_from($joints), usize::try_from($axes)) {
            $(
                (Ok($joint_count), Ok($axis_count)) => {
                    const $n: usize = $joint_count;
                    const $d: usize = $axis_count;
                    $then
                }
            )+
            _ => $otherwise,
        }
    };
}

/// The arms of [`with_arm!`](crate::with_arm), in words, for messages.
pub const SUPPORTED_ARMS: &str = "2 joints with 2 or 6 axes, 3 to 8 joints with 6";
