use super::*;

/// Numbers of every size, by a plain generator.
fn numbers(count: u64) -> impl Iterator<Item = f64> {
    (0..count).map(|i| f64::from_bits(i.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23) ^ (i << 17)))
}

#[test]
fn equal_sines_and_cosines_apart_and_together() {
    let small = (0..200_000).map(|i| f64::from(i - 100_000) * 1e-4);
    let tiny = (0..2000).map(|i| f64::from_bits(0x3e3f_0000_0000_0000 + (i << 44)));
    for x in numbers(300_000).chain(small).chain(tiny).chain([0.0, -0.0, PI, f64::INFINITY, f64::MIN_POSITIVE]) {
        let (s, c) = sin_cos(x);
        assert_eq!(s.to_bits(), sin(x).to_bits(), "{x}");
        assert_eq!(c.to_bits(), cos(x).to_bits(), "{x}");
        for alone in [sin_cos_lanes(&[x; 2]), sin_cos_lanes(&[x, 1.0])] {
            assert_eq!(alone.map(|lanes| lanes[0].to_bits()), [s, c].map(f64::to_bits), "{x}");
        }
    }
}

#[test]
fn equal_exponentials_one_by_one_and_by_lanes() {
    let edges = [0.5, 1.0, 1.5, 2.5].map(|turns| turns * std::f64::consts::LN_2);
    let near = |x: f64| (-20..=20).map(move |ulps: i64| f64::from_bits((x.to_bits() as i64 + ulps) as u64));
    let grid = (0..200_000u64).map(|i| 1e-3 * (i * i % 700_001) as f64);
    let small = (0..300).map(|i| exp(-0.1 * f64::from(i)));
    let ends = [0.0, f64::MIN_POSITIVE, 699.9, 708.4, 709.8, 745.2, 1e4, f64::INFINITY, f64::NAN];
    let edges = edges.into_iter().chain([700.0]).flat_map(near);
    for x in edges.chain(grid).chain(small).chain(ends).flat_map(|x| [x, -x]) {
        for alone in [exp_lanes(&[x; 2]), exp_lanes(&[x, 1.0])] {
            assert_eq!(alone[0].to_bits(), exp(x).to_bits(), "{x}");
        }
    }
}

#[test]
fn equal_powers_of_f32_and_those_of_f64() {
    for i in -870_000..=870_000 {
        let x = i as f32 * 1e-4;
        let [power, other] = exp_lanes_f32(&[x, -x]);
        let units = |power: f32, x: f32| (f64::from(power) / exp(f64::from(x)) - 1.0).abs() / f64::from(f32::EPSILON);
        assert!(units(power, x) < 1.5 && units(other, -x) < 1.5, "{x}");
    }
    assert_eq!(exp_lanes_f32(&[0.0, -0.0]), [1.0; 2]);
    let ends = exp_lanes_f32(&[87.0, -87.0]);
    assert!(ends[0].is_normal() && ends[1].is_normal());
    assert_eq!(exp_lanes_f32(&[f32::INFINITY, f32::NEG_INFINITY]), ends);
    assert_eq!(exp_lanes_f32(&[f32::MAX, f32::MIN]), ends);
    assert!(exp_lanes_f32(&[f32::NAN, -f32::NAN]).iter().all(|x| x.is_nan()));
}

#[test]
fn equal_logarithms_one_by_one_and_by_lanes() {
    let unit = (1..200_000).map(|i| f64::from(i) / 200_000.0);
    let positive = numbers(300_000).filter(|x| x.is_normal() && *x > 0.0);
    for x in positive.chain(unit).chain([1.0, f64::MIN_POSITIVE, f64::MAX, 0.5, 2.0, std::f64::consts::SQRT_2]) {
        assert_eq!(ln_lanes(&[x; 2]).map(f64::to_bits), [ln(x).to_bits(); 2], "{x}");
    }
}

#[test]
fn exact_wrapped_angles_stay_in_the_half_open_turn() {
    assert_eq!(wrap_angle(PI), PI);
    assert_eq!(wrap_angle(-PI), PI);
    assert!((wrap_angle(3.0 * TAU + 0.25) - 0.25).abs() < 1e-14);
    assert!((wrap_angle(-3.0 * TAU - 0.25) + 0.25).abs() < 1e-14);
}

/// A hash over 30,000 results of `mul_add`: operands of all sizes, sums that cancel to a few bits, and subnormal results.
#[inline(always)]
fn hash_of_mul_adds() -> u64 {
    let mut state = 0x1234_u64;
    let mut next = || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    };
    // Sign and digits of the word, exponent from `low` on.
    let number = |word: u64, low: u64, span: u64| {
        f64::from_bits(word & 0x800F_FFFF_FFFF_FFFF | (low + (word >> 52 & 0x7FF) % span) << 52)
    };
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for k in 0..30_000 {
        let (a, b, c) = (next(), next(), next());
        let (a, b, c) = match k % 3 {
            0 => (number(a, 1, 2046), number(b, 1, 2046), number(c, 1, 2046)),
            1 => {
                let (a, b) = (number(a, 900, 200), number(b, 900, 200));
                (a, b, f64::from_bits((-(a * b)).to_bits() + c % 5 - 2))
            }
            _ => (number(a, 400, 200), number(b, 400, 200), number(c, 0, 60)),
        };
        let sum = a.mul_add(b, c);
        let bits = if sum == 0.0 { 0 } else { sum.to_bits() };
        for byte in bits.to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
    hash
}

/// From exact rational arithmetic, rounded once: Python's `float(Fraction(a) * Fraction(b) + Fraction(c))`.
const EXACT_MUL_ADDS: u64 = 0x08d3_a664_8e69_b623;

#[test]
#[allow(unsafe_code)] // Calls what the CPU was asked for.
fn exact_mul_add_is_rounded_once_with_and_without_the_instruction() {
    assert_eq!(hash_of_mul_adds(), EXACT_MUL_ADDS);
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "fma")]
        fn by_instruction() -> u64 {
            hash_of_mul_adds()
        }
        if is_x86_feature_detected!("fma") {
            // SAFETY: the machine has the instruction.
            assert_eq!(unsafe { by_instruction() }, EXACT_MUL_ADDS);
        }
    }
    // The C library's routine takes the instruction where it finds it: the same test where it is hidden.
    const HIDDEN: (&str, &str) = ("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F");
    if std::env::var(HIDDEN.0).as_deref() != Ok(HIDDEN.1) {
        let this = "math::tests::exact_mul_add_is_rounded_once_with_and_without_the_instruction";
        let tests = std::env::current_exe().unwrap();
        let again = std::process::Command::new(tests).args(["--exact", this]).env(HIDDEN.0, HIDDEN.1).output();
        let again = again.unwrap();
        let said = String::from_utf8_lossy(&again.stdout);
        assert!(again.status.success() && said.contains("1 passed"), "{said}");
    }
}
