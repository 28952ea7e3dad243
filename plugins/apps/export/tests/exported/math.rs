//! The runtime's own exponentials, logarithms and powers: bit for bit those of the crate that the engine computes with.
//! `ATHERMAL_LONG=1` tries 20 million arguments of each.

use std::process::Command;

use athermal_core::prng::Prng;
use athermal_export::c::{RUNTIME, RUNTIME_HEADER, bits};

use crate::support::{Scratch, compilers, ran};

const DRIVER: &str = r#"#include "athermal_rt.c"
#include <stdio.h>

int main(void)
{
    double of[2];
    double is[5];
    while (fread(of, sizeof(double), 2, stdin) == 2) {
        int nth;
        is[0] = at_exp(of[0]);
        is[1] = at_exp2(of[0]);
        is[2] = at_log(of[0]);
        is[3] = at_expm1(of[0]);
        is[4] = at_pow(of[0], of[1]);
        for (nth = 0; nth < 5; nth++) {
            const uint64_t word = at_bits(is[nth]);
            (void)fwrite(&word, sizeof(word), 1, stdout);
        }
    }
    return 0;
}
"#;

/// Arguments that are not like others.
fn special() -> Vec<f64> {
    let sizes = [
        0.0,
        5e-324,
        2.225e-308,
        f64::MIN_POSITIVE,
        1e-300,
        1e-20,
        0.25,
        0.5,
        0.999_999_999_9,
        1.0,
        1.000_000_1,
        1.5,
        2.0,
        3.0,
        4.0,
        0.346_573_590_279_972_6,
        1.039_720_770_839_918,
        708.4,
        709.782_712_893_384,
        709.79,
        744.5,
        745.133_219_101_941_1,
        746.0,
        1022.0,
        1023.999,
        1024.0,
        1074.5,
        1075.0,
        2e9,
        4_294_967_295.0,
        9_007_199_254_740_991.0,
        9_007_199_254_740_992.0,
        1.8e19,
        3.7e19,
        1e100,
        1e300,
        f64::MAX,
        f64::INFINITY,
    ];
    let both = sizes.iter().flat_map(|&size| [size, -size]);
    both.chain([f64::NAN]).collect()
}

/// An argument: of any bits, near one, or of a size as votes have it.
fn argument(random: &mut Prng) -> f64 {
    let any = |random: &mut Prng| {
        let word = |random: &mut Prng| random.between(0.0, 4_294_967_296.0) as u64;
        f64::from_bits(word(random) << 32 | word(random))
    };
    let sign = if random.between(0.0, 1.0) < 0.3 {
        -1.0
    } else {
        1.0
    };
    match random.between(0.0, 6.0) as u64 {
        0 => any(random),
        1 => sign * (1.0 + 1e-6 * random.normal()),
        2 => random.between(0.0, 1.0),
        3 => random.between(-1100.0, 1100.0),
        // Whole and half ones.
        4 => 0.5 * (sign * random.between(0.0, 60.0)).round(),
        _ => sign * libm::exp(random.between(-60.0, 60.0)),
    }
}

#[test]
fn exponentials_logarithms_and_powers_in_c_are_those_of_the_engine_to_the_bit() {
    let is_long = std::env::var_os("ATHERMAL_LONG").is_some();
    let count = if is_long { 20_000_000 } else { 1_000_000 };
    let mut random = Prng::stream(9, "arguments");
    let special = special();
    let pairs = special
        .iter()
        .flat_map(|&x| special.iter().map(move |&y| (x, y)));
    let mut arguments: Vec<(f64, f64)> = pairs.collect();
    arguments.extend((0..count).map(|_| (argument(&mut random), argument(&mut random))));
    let scratch = Scratch::new("math");
    let folder = scratch.path("");
    for (name, text) in [
        ("athermal_rt.h", RUNTIME_HEADER),
        ("athermal_rt.c", RUNTIME),
        ("math.c", DRIVER),
    ] {
        std::fs::write(folder.join(name), text).unwrap();
    }
    let words = arguments.iter().flat_map(|of| [of.0, of.1]);
    let bytes: Vec<u8> = words.flat_map(f64::to_le_bytes).collect();
    std::fs::write(folder.join("arguments"), bytes).unwrap();
    for (compiler, level) in compilers().into_iter().zip(["-O2", "-O3"]) {
        let program = folder.join(compiler);
        ran(Command::new(compiler)
            .current_dir(&folder)
            .args([
                "-std=c99",
                "-ffp-contract=off",
                "-Wall",
                "-Wextra",
                "-Werror",
                level,
                "math.c",
                "-lm",
                "-o",
            ])
            .arg(&program));
        let output = Command::new(&program)
            .stdin(std::fs::File::open(folder.join("arguments")).unwrap())
            .output()
            .unwrap();
        let found: Vec<u64> = output
            .stdout
            .chunks_exact(8)
            .map(|word| u64::from_le_bytes(word.try_into().unwrap()))
            .collect();
        assert_eq!(found.len(), 5 * arguments.len());
        for (&(x, y), found) in arguments.iter().zip(found.chunks_exact(5)) {
            let expected = [
                libm::exp(x),
                libm::exp2(x),
                libm::log(x),
                libm::expm1(x),
                libm::pow(x, y),
            ]
            .map(bits);
            assert_eq!(
                found, expected,
                "{compiler}: exp, exp2, log, expm1 of {x:e}, and pow with {y:e}"
            );
        }
    }
}
