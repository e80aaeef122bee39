//! One source for several vector widths; the widest that the processor supports is chosen at run time.
//!
//! [`widest`](crate::widest) compiles an `#[inline(always)]` function once for each width and calls the right one. All widths
//! thus compute the same by construction, but for what is called by the name of an instruction; tests in debug builds run each of them.

use std::cell::Cell;
use std::sync::LazyLock;

/// Instruction sets that the compiler may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Width {
    /// Those of every processor of the architecture.
    Portable,
    /// AVX2 and the bit instructions of the same generation.
    Avx2,
    /// AVX-512 F, BW, DQ and VL, and all of the above.
    Avx512,
}

thread_local! {
    /// The width that [`widths`] asks for.
    static FORCED: Cell<Option<Width>> = const { Cell::new(None) };
}

/// The widest that this processor supports.
#[inline]
pub fn width() -> Width {
    static DETECTED: LazyLock<Width> = LazyLock::new(detected);
    let forced = if cfg!(debug_assertions) { FORCED.get() } else { None };
    forced.unwrap_or_else(|| *DETECTED)
}

/// The results of `work` at every width that this processor supports, for tests. Release builds use the widest all the time.
pub fn widths<T>(mut work: impl FnMut() -> T) -> Vec<(Width, T)> {
    let all = [Width::Portable, Width::Avx2, Width::Avx512];
    let results = all.into_iter().filter(|w| *w <= detected()).map(|w| {
        FORCED.set(Some(w));
        let result = work();
        FORCED.set(None);
        (w, result)
    });
    results.collect()
}

fn detected() -> Width {
    #[cfg(target_arch = "x86_64")]
    {
        macro_rules! has {
            ($($feature:tt)*) => { $(is_x86_feature_detected!($feature) &&)* true };
        }
        let avx2 = has!("avx2" "bmi1" "bmi2" "lzcnt" "popcnt");
        if avx2 && has!("avx512f" "avx512bw" "avx512dq" "avx512vl") {
            return Width::Avx512;
        } else if avx2 {
            return Width::Avx2;
        }
    }
    Width::Portable
}

/// Defines a function that calls `lanes`, compiled for the widest vectors that the processor supports. `lanes`
/// must be `#[inline(always)]`.
#[macro_export]
macro_rules! widest {
    (
        $(#[$doc:meta])*
        $vis:vis fn $name:ident($($arg:ident: $type:ty),* $(,)?) $(-> $result:ty)? = $lanes:path;
    ) => {
        $(#[$doc])*
        #[inline]
        $vis fn $name($($arg: $type),*) $(-> $result)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(
                    enable = "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512bw,avx512dq,avx512vl"
                )]
                fn avx512($($arg: $type),*) $(-> $result)? {
                    $lanes($($arg),*)
                }
                #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
                fn avx2($($arg: $type),*) $(-> $result)? {
                    $lanes($($arg),*)
                }
                match $crate::wide::width() {
                    // SAFETY: the function only requires that the processor has the features that it is
                    // compiled for, and `width` returns a width after detecting all of them.
                    $crate::wide::Width::Avx512 => return unsafe { avx512($($arg),*) },
                    // SAFETY: as above.
                    $crate::wide::Width::Avx2 => return unsafe { avx2($($arg),*) },
                    $crate::wide::Width::Portable => {}
                }
            }
            $lanes($($arg),*)
        }
    };
}

/// Defines a function with a body of its own for AVX-512, for instructions that the compiler does not find.
#[macro_export]
macro_rules! with_avx512 {
    (
        $(#[$doc:meta])*
        $vis:vis fn $name:ident($($arg:ident: $type:ty),*) -> $result:ty { $($avx512:tt)* }
        else $portable:block
    ) => {
        $(#[$doc])*
        #[inline(always)]
        $vis fn $name($($arg: $type),*) -> $result {
            #[cfg(target_arch = "x86_64")]
            if $crate::wide::width() == $crate::wide::Width::Avx512 {
                #[inline]
                #[target_feature(enable = "avx512f,avx512bw")]
                fn avx512($($arg: $type),*) -> $result {
                    use std::arch::x86_64::*;
                    $($avx512)*
                }
                // SAFETY: this width is used only on processors with AVX-512 F and BW.
                return unsafe { avx512($($arg),*) };
            }
            $portable
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_forced_width_is_used() {
        for (forced, used) in widths(width) {
            assert_eq!(used, if cfg!(debug_assertions) { forced } else { detected() });
        }
        assert_eq!(width(), detected());
    }
}
