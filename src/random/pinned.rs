//! `f64` with the functions of the pinned `libm` -> the number type that rand_distr's samplers compute with.
//!
//! rand_distr takes its logarithms and powers from num-traits, and num-traits, with the feature `std` that other dependencies switch on,
//! from the C library of the machine, whose last bits differ between machines. The program binds the C library's names to `libm`
//! (`c_symbols`), but a program that links marsyard as a library does not. The samplers are generic in their number type; with
//! [`Pinned`] every function that they call is `libm`'s, whoever links them, and so are the normal, exponential and uniform draws they ask
//! for. `sqrt`, `floor` and their like are exact by IEEE 754 and are the CPU's.

use std::num::FpCategory;
use std::ops::{Add, Div, Mul, Neg, Rem, Sub};

use rand::Rng;
use rand_distr::num_traits::{Float, Num, NumCast, One, ToPrimitive, Zero};
use rand_distr::{Distribution, Exp1, Open01, StandardNormal, StandardUniform};

use super::normal::normal_from_open_unit;
use super::stream::open_unit;
use crate::math;

#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(super) struct Pinned(pub f64);

/// Uniform in (0, 1), as every other draw of the program: the middle of one of 2^52 equal parts.
impl Distribution<Pinned> for Open01 {
    fn sample<R: Rng + ?Sized>(&self, rng: &mut R) -> Pinned {
        Pinned(open_unit(rng.next_u64()))
    }
}

impl Distribution<Pinned> for StandardUniform {
    fn sample<R: Rng + ?Sized>(&self, rng: &mut R) -> Pinned {
        Open01.sample(rng)
    }
}

impl Distribution<Pinned> for StandardNormal {
    fn sample<R: Rng + ?Sized>(&self, rng: &mut R) -> Pinned {
        Pinned(normal_from_open_unit(open_unit(rng.next_u64())))
    }
}

impl Distribution<Pinned> for Exp1 {
    fn sample<R: Rng + ?Sized>(&self, rng: &mut R) -> Pinned {
        Pinned(-math::ln(open_unit(rng.next_u64())))
    }
}

macro_rules! operators {
    ($($name:ident $method:ident;)*) => {$(
        impl $name for Pinned {
            type Output = Pinned;
            fn $method(self, other: Pinned) -> Pinned { Pinned($name::$method(self.0, other.0)) }
        }
    )*};
}
operators! { Add add; Sub sub; Mul mul; Div div; Rem rem; }

impl Neg for Pinned {
    type Output = Pinned;
    fn neg(self) -> Pinned {
        Pinned(-self.0)
    }
}

impl Zero for Pinned {
    fn zero() -> Pinned {
        Pinned(0.0)
    }
    fn is_zero(&self) -> bool {
        self.0 == 0.0
    }
}

impl One for Pinned {
    fn one() -> Pinned {
        Pinned(1.0)
    }
}

impl Num for Pinned {
    type FromStrRadixErr = <f64 as Num>::FromStrRadixErr;
    fn from_str_radix(text: &str, radix: u32) -> Result<Pinned, Self::FromStrRadixErr> {
        f64::from_str_radix(text, radix).map(Pinned)
    }
}

impl ToPrimitive for Pinned {
    fn to_i64(&self) -> Option<i64> {
        self.0.to_i64()
    }
    fn to_u64(&self) -> Option<u64> {
        self.0.to_u64()
    }
    fn to_f64(&self) -> Option<f64> {
        Some(self.0)
    }
}

impl NumCast for Pinned {
    fn from<T: ToPrimitive>(value: T) -> Option<Pinned> {
        value.to_f64().map(Pinned)
    }
}

macro_rules! float {
    (
        constants { $($constant:ident = $value:expr;)* }
        questions { $($question:ident)* }
        exact { $($exact:ident)* }
        exact_of_two { $($exact_of_two:ident)* }
        pinned { $($name:ident = $source:path;)* }
        pinned_of_two { $($name_of_two:ident = $source_of_two:path;)* }
    ) => {
        impl Float for Pinned {
            $(fn $constant() -> Pinned { Pinned($value) })*
            $(fn $question(self) -> bool { self.0.$question() })*
            $(fn $exact(self) -> Pinned { Pinned(self.0.$exact()) })*
            $(fn $exact_of_two(self, other: Pinned) -> Pinned { Pinned(self.0.$exact_of_two(other.0)) })*
            $(fn $name(self) -> Pinned { Pinned($source(self.0)) })*
            $(fn $name_of_two(self, other: Pinned) -> Pinned { Pinned($source_of_two(self.0, other.0)) })*

            fn classify(self) -> FpCategory {
                self.0.classify()
            }
            fn mul_add(self, factor: Pinned, sum: Pinned) -> Pinned {
                Pinned(self.0.mul_add(factor.0, sum.0))
            }
            fn powi(self, n: i32) -> Pinned {
                Pinned(math::pow(self.0, n.into()))
            }
            fn log(self, base: Pinned) -> Pinned {
                Pinned(math::ln(self.0) / math::ln(base.0))
            }
            fn sin_cos(self) -> (Pinned, Pinned) {
                let (sin, cos) = math::sin_cos(self.0);
                (Pinned(sin), Pinned(cos))
            }
            fn integer_decode(self) -> (u64, i16, i8) {
                Float::integer_decode(self.0)
            }
        }
    };
}

float! {
    constants {
        nan = f64::NAN;
        infinity = f64::INFINITY;
        neg_infinity = f64::NEG_INFINITY;
        neg_zero = -0.0;
        min_value = f64::MIN;
        min_positive_value = f64::MIN_POSITIVE;
        max_value = f64::MAX;
        epsilon = f64::EPSILON;
    }
    questions { is_nan is_infinite is_finite is_normal is_sign_positive is_sign_negative }
    exact { floor ceil round trunc fract abs signum recip sqrt }
    exact_of_two { max min copysign }
    pinned {
        exp = math::exp;
        exp2 = libm::exp2;
        exp_m1 = math::exp_m1;
        ln = math::ln;
        ln_1p = math::ln_1p;
        log2 = libm::log2;
        log10 = libm::log10;
        cbrt = math::cbrt;
        sin = math::sin;
        cos = math::cos;
        tan = math::tan;
        asin = math::asin;
        acos = math::acos;
        atan = math::atan;
        sinh = libm::sinh;
        cosh = libm::cosh;
        tanh = libm::tanh;
        asinh = libm::asinh;
        acosh = libm::acosh;
        atanh = libm::atanh;
    }
    pinned_of_two {
        powf = math::pow;
        atan2 = math::atan2;
        hypot = math::hypot;
        abs_sub = libm::fdim;
    }
}
