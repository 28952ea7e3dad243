/* The runtime of exported graphs; see athermal_rt.h. */
#include "athermal_rt.h"

/* For a program with one graph: the file of its header, which says what the graph uses. The rest is then left out. */
#ifdef ATHERMAL_PLAN
#include ATHERMAL_PLAN
#endif
#ifndef AT_USES
#define AT_USES 0xffffffffu
#endif
#define AT_IS_USED(part) (((AT_USES >> (part)) & 1u) != 0u)

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

#define AT_NAN ((at_real)NAN)

/* The first integers of a state. */
#define AT_TICK 0
#define AT_LAST 1
#define AT_HAS_LAST 2
#define AT_HAS_BREAK 3
#define AT_BREAK 4
#define AT_REFUSED_COUNT 5
#define AT_FLAGS 6
#define AT_LOADED 7 /* whether no tick has come since the state was loaded; never saved */

/* ---- Time: nanoseconds, saturating. */

static int64_t at_plus(int64_t a, int64_t b)
{
    int64_t sum;
    if ((b > 0) && (a > (INT64_MAX - b))) {
        sum = INT64_MAX;
    } else if ((b < 0) && (a < (INT64_MIN - b))) {
        sum = INT64_MIN;
    } else {
        sum = a + b;
    }
    return sum;
}

static int64_t at_minus(int64_t a, int64_t b)
{
    int64_t difference;
    if ((b < 0) && (a > (INT64_MAX + b))) {
        difference = INT64_MAX;
    } else if ((b > 0) && (a < (INT64_MIN + b))) {
        difference = INT64_MIN;
    } else {
        difference = a - b;
    }
    return difference;
}

static at_real at_seconds(int64_t ns)
{
    return (at_real)((double)ns / 1.0e9);
}

static int at_is_absent(at_real value)
{
    return isnan(value) ? 1 : 0;
}

static at_real at_unless_infinite(at_real value)
{
    return isinf(value) ? AT_NAN : value;
}

static at_real at_size(at_real value)
{
    return (at_real)fabs((double)value);
}

static at_real at_root(at_real value)
{
    return (at_real)sqrt((double)value);
}

/* A size with the sign of a value. */
static at_real at_signed(at_real size, at_real of)
{
    return (signbit(of) != 0) ? -size : size;
}

/* A quotient with the bits that a division by 0 has, without one: that a processor may trap. */
static at_real at_over(at_real value, at_real by)
{
    at_real is = AT_NAN;
    if (by != AT_R(0.0)) {
        is = value / by;
    } else if ((at_is_absent(value) == 0) && (value != AT_R(0.0))) {
        is = ((signbit(value) != 0) != (signbit(by) != 0)) ? -(at_real)INFINITY : (at_real)INFINITY;
    } else {
        /* It is none. */
    }
    return is;
}

uint64_t at_bits(double value)
{
    union {
        double number;
        uint64_t bits;
    } both;
    both.number = value;
    /* Every NaN means absent. */
    return isnan(value) ? UINT64_C(0x7ff8000000000000) : both.bits;
}

static double at_number(uint64_t bits)
{
    union {
        double number;
        uint64_t bits;
    } both;
    both.bits = bits;
    return both.number;
}

uint64_t at_hash(uint64_t hash, uint64_t bits)
{
    uint64_t mixed = hash;
    uint32_t shift;
    for (shift = 0; shift < 64u; shift += 8u) {
        mixed = (mixed ^ ((bits >> shift) & UINT64_C(0xff))) * UINT64_C(0x100000001b3);
    }
    return mixed;
}

/* c0 + x (c1 + x (c2 + ...)). */
static double at_polynomial(const double coefficients[], int32_t count, double x)
{
    double sum = coefficients[count - 1];
    int32_t nth;
    for (nth = count - 2; nth >= 0; nth--) {
        sum = coefficients[nth] + (x * sum);
    }
    return sum;
}

/* Of the exponential of small x, for at_exp and at_pow. */
static const double at_of_exp[5] = { 1.66666666666666019037e-01, -2.77777777770155933842e-03, 6.61375632143793436117e-05,
                                     -1.65339022054652515390e-06, 4.13813679705723846039e-08 };

/* e^x - 1, after FreeBSD's msun, s_expm1.c:
 *
 * Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved.
 * Developed at SunPro, a Sun Microsystems, Inc. business.
 * Permission to use, copy, modify, and distribute this software is freely granted, provided that this notice is preserved.
 */
static double at_expm1(double of)
{
    const double ln2_hi = 6.93147180369123816490e-01;
    const double ln2_lo = 1.90821492927058770002e-10;
    const double inverse_ln2 = 1.44269504088896338700e+00;
    static const double q[5] = { -3.33333333333331316428e-02, 1.58730158725481460165e-03, -7.93650757867487942473e-05,
                                 4.00821782732936239552e-06, -2.01099218183624371326e-07 };
    const uint64_t bits = at_bits(of);
    const uint32_t high = (uint32_t)((bits >> 32) & UINT64_C(0x7fffffff));
    const int negative = ((bits >> 63) != 0u) ? 1 : 0;
    double x = of;
    double c = 0.0;
    double hi;
    double lo;
    double t;
    double y;
    double e;
    double r1;
    double half;
    double square;
    int32_t k = 0;
    if (high >= 0x4043687Au) {
        if (isnan(x)) {
            return x;
        }
        if (negative != 0) {
            return -1.0;
        }
        if (x > 7.09782712893383973096e+02) {
            return x * at_number(UINT64_C(0x7fe0000000000000));
        }
    }
    if (high > 0x3fd62e42u) {
        if (high < 0x3FF0A2B2u) {
            hi = (negative != 0) ? (x + ln2_hi) : (x - ln2_hi);
            lo = (negative != 0) ? -ln2_lo : ln2_lo;
            k = (negative != 0) ? -1 : 1;
        } else {
            k = (int32_t)((inverse_ln2 * x) + ((negative != 0) ? -0.5 : 0.5));
            t = (double)k;
            hi = x - (t * ln2_hi);
            lo = t * ln2_lo;
        }
        x = hi - lo;
        c = (hi - x) - lo;
    } else if (high < 0x3c900000u) {
        return x;
    } else {
        k = 0;
    }
    half = 0.5 * x;
    square = x * half;
    r1 = 1.0 + (square * at_polynomial(q, 5, square));
    t = 3.0 - (r1 * half);
    e = square * ((r1 - t) / (6.0 - (x * t)));
    if (k == 0) {
        return x - ((x * e) - square);
    }
    e = (x * (e - c)) - c;
    e -= square;
    if (k == -1) {
        return (0.5 * (x - e)) - 0.5;
    }
    if (k == 1) {
        return (x < -0.25) ? (-2.0 * (e - (x + 0.5))) : (1.0 + (2.0 * (x - e)));
    }
    if ((k < 0) || (k > 56)) {
        y = (x - e) + 1.0;
        if (k == 1024) {
            y = (y * 2.0) * at_number(UINT64_C(0x7fe0000000000000));
        } else {
            y = y * at_number((uint64_t)(0x3ff + k) << 52);
        }
        return y - 1.0;
    }
    t = at_number((uint64_t)(0x3ff - k) << 52);
    if (k < 20) {
        y = (x - e) + (1.0 - t);
    } else {
        y = (x - (e + t)) + 1.0;
    }
    return y * at_number((uint64_t)(0x3ff + k) << 52);
}

/* ---- Exponentials, logarithms and powers, as the crate `libm` computes them for the engine: those of FreeBSD's msun, of which the C
 * library of a controller may have others. */

static uint32_t at_high_word(double of)
{
    return (uint32_t)(at_bits(of) >> 32);
}

static double at_with_high_word(double of, uint32_t high)
{
    return at_number(((uint64_t)high << 32) | (at_bits(of) & UINT64_C(0xffffffff)));
}

static double at_without_low_word(double of)
{
    return at_number(at_bits(of) & UINT64_C(0xffffffff00000000));
}

/* x times 2^n, rounded once. */
static double at_scaled(double x, int32_t n)
{
    const double most = at_number(UINT64_C(0x7fe0000000000000));
    /* 2^-969: what is scaled by it to stay above the least number does not become subnormal. */
    const double least = at_number(UINT64_C(0x0360000000000000));
    double y = x;
    int32_t left = n;
    int32_t turn;
    for (turn = 0; (turn < 2) && (left > 1023); turn++) {
        y = y * most;
        left -= 1023;
    }
    for (turn = 0; (turn < 2) && (left < -1022); turn++) {
        y = y * least;
        left += 969;
    }
    if (left > 1023) {
        left = 1023;
    }
    if (left < -1022) {
        left = -1022;
    }
    return y * at_number((uint64_t)(0x3ff + left) << 52);
}

/* e^x, after e_exp.c:
 *
 * Copyright (C) 2004 by Sun Microsystems, Inc. All rights reserved.
 * Permission to use, copy, modify, and distribute this software is freely granted, provided that this notice is preserved.
 */
static double at_exp(double of)
{
    const double ln2_hi = 6.93147180369123816490e-01;
    const double ln2_lo = 1.90821492927058770002e-10;
    const double inverse_ln2 = 1.44269504088896338700e+00;
    const uint32_t high = at_high_word(of) & 0x7fffffffu;
    const int negative = ((at_bits(of) >> 63) != 0u) ? 1 : 0;
    double x = of;
    double hi = of;
    double lo = 0.0;
    double square;
    double c;
    double y;
    int32_t k = 0;
    if (high >= 0x4086232bu) {
        if (isnan(x)) {
            return x;
        }
        if (x > 709.782712893383973096) {
            return x * at_number(UINT64_C(0x7fe0000000000000));
        }
        if (x < -745.13321910194110842) {
            return 0.0;
        }
    }
    if (high > 0x3fd62e42u) {
        if (high >= 0x3ff0a2b2u) {
            k = (int32_t)((inverse_ln2 * x) + ((negative != 0) ? -0.5 : 0.5));
        } else {
            k = (negative != 0) ? -1 : 1;
        }
        hi = x - ((double)k * ln2_hi);
        lo = (double)k * ln2_lo;
        x = hi - lo;
    } else if (high <= 0x3e300000u) {
        return 1.0 + x;
    } else {
        /* It is small enough. */
    }
    square = x * x;
    c = x - (square * at_polynomial(at_of_exp, 5, square));
    y = 1.0 + ((((x * c) / (2.0 - c)) - lo) + hi);
    return (k == 0) ? y : at_scaled(y, k);
}

/* The natural logarithm, after e_log.c:
 *
 * Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved.
 * Developed at SunSoft, a Sun Microsystems, Inc. business.
 * Permission to use, copy, modify, and distribute this software is freely granted, provided that this notice is preserved.
 */
static double at_log(double of)
{
    const double ln2_hi = 6.93147180369123816490e-01;
    const double ln2_lo = 1.90821492927058770002e-10;
    static const double odd[4] = { 6.666666666666735130e-01, 2.857142874366239149e-01, 1.818357216161805012e-01,
                                   1.479819860511658591e-01 };
    static const double even[3] = { 3.999999999940941908e-01, 2.222219843214978396e-01, 1.531383769920937332e-01 };
    double x = of;
    double f;
    double half;
    double s;
    double z;
    double w;
    double r;
    double dk;
    uint32_t high;
    int32_t k = 0;
    if (isnan(x)) {
        return x;
    }
    if (x == 0.0) {
        return -(double)INFINITY;
    }
    if (x < 0.0) {
        return (double)NAN;
    }
    high = at_high_word(x);
    if (high >= 0x7ff00000u) {
        return x;
    }
    if (x == 1.0) {
        return 0.0;
    }
    if (high < 0x00100000u) {
        k = -54;
        x = x * at_number(UINT64_C(0x4350000000000000));
        high = at_high_word(x);
    }
    high += 0x3ff00000u - 0x3fe6a09eu;
    k += (int32_t)(high >> 20) - 0x3ff;
    high = (high & 0x000fffffu) + 0x3fe6a09eu;
    x = at_with_high_word(x, high);
    f = x - 1.0;
    half = (0.5 * f) * f;
    s = f / (2.0 + f);
    z = s * s;
    w = z * z;
    r = (z * at_polynomial(odd, 4, w)) + (w * at_polynomial(even, 3, w));
    dk = (double)k;
    return ((((s * (half + r)) + (dk * ln2_lo)) - half) + f) + (dk * ln2_hi);
}

/* 2^x, after s_exp2.c:
 *
 * Copyright (c) 2005 David Schultz <das@FreeBSD.ORG>
 * All rights reserved.
 *
 * Redistribution and use in source and binary forms, with or without
 * modification, are permitted provided that the following conditions
 * are met:
 * 1. Redistributions of source code must retain the above copyright
 *    notice, this list of conditions and the following disclaimer.
 * 2. Redistributions in binary form must reproduce the above copyright
 *    notice, this list of conditions and the following disclaimer in the
 *    documentation and/or other materials provided with the distribution.
 *
 * THIS SOFTWARE IS PROVIDED BY THE AUTHOR AND CONTRIBUTORS ``AS IS'' AND
 * ANY EXPRESS OR IMPLIED WARRANTIES, INCLUDING, BUT NOT LIMITED TO, THE
 * IMPLIED WARRANTIES OF MERCHANTABILITY AND FITNESS FOR A PARTICULAR PURPOSE
 * ARE DISCLAIMED.  IN NO EVENT SHALL THE AUTHOR OR CONTRIBUTORS BE LIABLE
 * FOR ANY DIRECT, INDIRECT, INCIDENTAL, SPECIAL, EXEMPLARY, OR CONSEQUENTIAL
 * DAMAGES (INCLUDING, BUT NOT LIMITED TO, PROCUREMENT OF SUBSTITUTE GOODS
 * OR SERVICES; LOSS OF USE, DATA, OR PROFITS; OR BUSINESS INTERRUPTION)
 * HOWEVER CAUSED AND ON ANY THEORY OF LIABILITY, WHETHER IN CONTRACT, STRICT
 * LIABILITY, OR TORT (INCLUDING NEGLIGENCE OR OTHERWISE) ARISING IN ANY WAY
 * OUT OF THE USE OF THIS SOFTWARE, EVEN IF ADVISED OF THE POSSIBILITY OF
 * SUCH DAMAGE.
 *
 * The bits of 2^(nth/256 - 1/2) a little beside that place, and the upper half of the bits of how much. */
#define AT_POWERS 256u

static double at_exp2(double of)
{
    static const uint64_t powers[AT_POWERS] = {
        UINT64_C(0x3fe6a09e667f3d5d), UINT64_C(0x3fe6b052fa751744), UINT64_C(0x3fe6c012750bd9fe), UINT64_C(0x3fe6cfdcddd476bf),
        UINT64_C(0x3fe6dfb23c651a29), UINT64_C(0x3fe6ef9298593ae3), UINT64_C(0x3fe6ff7df9519386), UINT64_C(0x3fe70f7466f42da3),
        UINT64_C(0x3fe71f75e8ec5fc3), UINT64_C(0x3fe72f8286eacf05), UINT64_C(0x3fe73f9a48a58152), UINT64_C(0x3fe74fbd35d7ccfc),
        UINT64_C(0x3fe75feb564267f1), UINT64_C(0x3fe77024b1ab6d48), UINT64_C(0x3fe780694fde5d38), UINT64_C(0x3fe790b938ac1d00),
        UINT64_C(0x3fe7a11473eb0178), UINT64_C(0x3fe7b17b0976d060), UINT64_C(0x3fe7c1ed0130c133), UINT64_C(0x3fe7d26a62ff8636),
        UINT64_C(0x3fe7e2f336cf4e3b), UINT64_C(0x3fe7f3878491c3e8), UINT64_C(0x3fe80427543e1b4e), UINT64_C(0x3fe814d2add1071a),
        UINT64_C(0x3fe82589994ccd7e), UINT64_C(0x3fe8364c1eb942d0), UINT64_C(0x3fe8471a4623cab5), UINT64_C(0x3fe857f4179f5bbc),
        UINT64_C(0x3fe868d99b4491af), UINT64_C(0x3fe879cad931a395), UINT64_C(0x3fe88ac7d98a65b8), UINT64_C(0x3fe89bd0a4785800),
        UINT64_C(0x3fe8ace5422aa223), UINT64_C(0x3fe8be05bad619fa), UINT64_C(0x3fe8cf3216b54383), UINT64_C(0x3fe8e06a5e08664c),
        UINT64_C(0x3fe8f1ae99157807), UINT64_C(0x3fe902fed0282c0e), UINT64_C(0x3fe9145b0b91ff96), UINT64_C(0x3fe925c353aa2ff9),
        UINT64_C(0x3fe93737b0cdc64a), UINT64_C(0x3fe948b82b5f98ae), UINT64_C(0x3fe95a44cbc852cb), UINT64_C(0x3fe96bdd9a766f21),
        UINT64_C(0x3fe97d829fde4e2a), UINT64_C(0x3fe98f33e47a23a3), UINT64_C(0x3fe9a0f170ca0604), UINT64_C(0x3fe9b2bb4d53ff89),
        UINT64_C(0x3fe9c49182a3f15b), UINT64_C(0x3fe9d674194bb8c5), UINT64_C(0x3fe9e86319e3238e), UINT64_C(0x3fe9fa5e8d07f302),
        UINT64_C(0x3fea0c667b5de54d), UINT64_C(0x3fea1e7aed8eb8f6), UINT64_C(0x3fea309bec4a2e27), UINT64_C(0x3fea42c980460a5d),
        UINT64_C(0x3fea5503b23e259b), UINT64_C(0x3fea674a8af46213), UINT64_C(0x3fea799e1330b3a7), UINT64_C(0x3fea8bfe53c12e8d),
        UINT64_C(0x3fea9e6b5579fcd2), UINT64_C(0x3feab0e521356fb8), UINT64_C(0x3feac36bbfd3f381), UINT64_C(0x3fead5ff3a3c2780),
        UINT64_C(0x3feae89f995ad2a3), UINT64_C(0x3feafb4ce622f367), UINT64_C(0x3feb0e07298db790), UINT64_C(0x3feb20ce6c9a89a9),
        UINT64_C(0x3feb33a2b84f1a4b), UINT64_C(0x3feb468415b747e7), UINT64_C(0x3feb59728de5593a), UINT64_C(0x3feb6c6e29f1c56a),
        UINT64_C(0x3feb7f76f2fb5e50), UINT64_C(0x3feb928cf22749b2), UINT64_C(0x3feba5b030a10603), UINT64_C(0x3febb8e0b79a6f66),
        UINT64_C(0x3febcc1e904bc1ff), UINT64_C(0x3febdf69c3f3a16f), UINT64_C(0x3febf2c25bd71db8), UINT64_C(0x3fec06286141b2e9),
        UINT64_C(0x3fec199bdd8552e0), UINT64_C(0x3fec2d1cd9fa64ee), UINT64_C(0x3fec40ab5fffd02f), UINT64_C(0x3fec544778fafd15),
        UINT64_C(0x3fec67f12e57d0cb), UINT64_C(0x3fec7ba88988c1b6), UINT64_C(0x3fec8f6d9406e733), UINT64_C(0x3feca3405751c4df),
        UINT64_C(0x3fecb720dcef9094), UINT64_C(0x3feccb0f2e6d1689), UINT64_C(0x3fecdf0b555dc412), UINT64_C(0x3fecf3155b5bab3b),
        UINT64_C(0x3fed072d4a0789bc), UINT64_C(0x3fed1b532b08c8fa), UINT64_C(0x3fed2f87080d8a85), UINT64_C(0x3fed43c8eacaa203),
        UINT64_C(0x3fed5818dcfba491), UINT64_C(0x3fed6c76e862e6a1), UINT64_C(0x3fed80e316c9834e), UINT64_C(0x3fed955d71ff6090),
        UINT64_C(0x3feda9e603db32ae), UINT64_C(0x3fedbe7cd63a8325), UINT64_C(0x3fedd321f301b445), UINT64_C(0x3fede7d5641c05bf),
        UINT64_C(0x3fedfc97337b9aec), UINT64_C(0x3fee11676b197d5e), UINT64_C(0x3fee264614f5a3e7), UINT64_C(0x3fee3b333b16ee5c),
        UINT64_C(0x3fee502ee78b3fb4), UINT64_C(0x3fee653924676d68), UINT64_C(0x3fee7a51fbc74c44), UINT64_C(0x3fee8f7977cdb726),
        UINT64_C(0x3feea4afa2a490e8), UINT64_C(0x3feeb9f4867ccae4), UINT64_C(0x3feecf482d8e680d), UINT64_C(0x3feee4aaa2188514),
        UINT64_C(0x3feefa1bee615a13), UINT64_C(0x3fef0f9c1cb64106), UINT64_C(0x3fef252b376bb963), UINT64_C(0x3fef3ac948dd7275),
        UINT64_C(0x3fef50765b6e4524), UINT64_C(0x3fef6632798844fd), UINT64_C(0x3fef7bfdad9cbe38), UINT64_C(0x3fef91d802243c82),
        UINT64_C(0x3fefa7c1819e908e), UINT64_C(0x3fefbdba3692d511), UINT64_C(0x3fefd3c22b8f7194), UINT64_C(0x3fefe9d96b2a23ee),
        UINT64_C(0x3ff0000000000000), UINT64_C(0x3ff00b1afa5abcbe), UINT64_C(0x3ff0163da9fb3303), UINT64_C(0x3ff02168143b0282),
        UINT64_C(0x3ff02c9a3e77806c), UINT64_C(0x3ff037d42e11bbca), UINT64_C(0x3ff04315e86e7f89), UINT64_C(0x3ff04e5f72f65467),
        UINT64_C(0x3ff059b0d315855a), UINT64_C(0x3ff0650a0e3c1f95), UINT64_C(0x3ff0706b29ddf71a), UINT64_C(0x3ff07bd42b72a82d),
        UINT64_C(0x3ff0874518759bd0), UINT64_C(0x3ff092bdf66607c8), UINT64_C(0x3ff09e3ecac6f383), UINT64_C(0x3ff0a9c79b1f3930),
        UINT64_C(0x3ff0b5586cf988fc), UINT64_C(0x3ff0c0f145e46c8a), UINT64_C(0x3ff0cc922b724816), UINT64_C(0x3ff0d83b23395dd8),
        UINT64_C(0x3ff0e3ec32d3d1f3), UINT64_C(0x3ff0efa55fdfa9a6), UINT64_C(0x3ff0fb66affed2f0), UINT64_C(0x3ff1073028d7234b),
        UINT64_C(0x3ff11301d0125b5b), UINT64_C(0x3ff11edbab5e2af9), UINT64_C(0x3ff12abdc06c31d5), UINT64_C(0x3ff136a814f2047d),
        UINT64_C(0x3ff1429aaea92de9), UINT64_C(0x3ff14e95934f3138), UINT64_C(0x3ff15a98c8a58e71), UINT64_C(0x3ff166a45471c3df),
        UINT64_C(0x3ff172b83c7d5211), UINT64_C(0x3ff17ed48695bb9f), UINT64_C(0x3ff18af9388c8d93), UINT64_C(0x3ff1972658375d66),
        UINT64_C(0x3ff1a35beb6fcba7), UINT64_C(0x3ff1af99f81387e3), UINT64_C(0x3ff1bbe084045d54), UINT64_C(0x3ff1c82f95281c43),
        UINT64_C(0x3ff1d4873168b9b2), UINT64_C(0x3ff1e0e75eb44031), UINT64_C(0x3ff1ed5022fcd938), UINT64_C(0x3ff1f9c18438cdf7),
        UINT64_C(0x3ff2063b88628d8f), UINT64_C(0x3ff212be3578a81e), UINT64_C(0x3ff21f49917ddd41), UINT64_C(0x3ff22bdda2791323),
        UINT64_C(0x3ff2387a6e7561e7), UINT64_C(0x3ff2451ffb821427), UINT64_C(0x3ff251ce4fb2a602), UINT64_C(0x3ff25e85711eceb0),
        UINT64_C(0x3ff26b4565e27d16), UINT64_C(0x3ff2780e341de00f), UINT64_C(0x3ff284dfe1f5633e), UINT64_C(0x3ff291ba7591bb30),
        UINT64_C(0x3ff29e9df51fdf09), UINT64_C(0x3ff2ab8a66d10e9b), UINT64_C(0x3ff2b87fd0dada3a), UINT64_C(0x3ff2c57e39771af9),
        UINT64_C(0x3ff2d285a6e402d9), UINT64_C(0x3ff2df961f641579), UINT64_C(0x3ff2ecafa93e2ecf), UINT64_C(0x3ff2f9d24abd8822),
        UINT64_C(0x3ff306fe0a31b625), UINT64_C(0x3ff31432edeea50b), UINT64_C(0x3ff32170fc4cd7b8), UINT64_C(0x3ff32eb83ba8e9a2),
        UINT64_C(0x3ff33c08b2641766), UINT64_C(0x3ff3496266e3fa27), UINT64_C(0x3ff356c55f929f0f), UINT64_C(0x3ff36431a2de88b9),
        UINT64_C(0x3ff371a7373aaa39), UINT64_C(0x3ff37f26231e74fe), UINT64_C(0x3ff38cae6d05d838), UINT64_C(0x3ff39a401b713ec3),
        UINT64_C(0x3ff3a7db34e5a020), UINT64_C(0x3ff3b57fbfec6e95), UINT64_C(0x3ff3c32dc313a8f2), UINT64_C(0x3ff3d0e544ede122),
        UINT64_C(0x3ff3dea64c1234bb), UINT64_C(0x3ff3ec70df1c4ecc), UINT64_C(0x3ff3fa4504ac7e8c), UINT64_C(0x3ff40822c367a0bb),
        UINT64_C(0x3ff4160a21f72e95), UINT64_C(0x3ff423fb27094646), UINT64_C(0x3ff431f5d950a920), UINT64_C(0x3ff43ffa3f84b9eb),
        UINT64_C(0x3ff44e0860618919), UINT64_C(0x3ff45c2042a7d201), UINT64_C(0x3ff46a41ed1d0016), UINT64_C(0x3ff4786d668b3326),
        UINT64_C(0x3ff486a2b5c13c00), UINT64_C(0x3ff494e1e192af04), UINT64_C(0x3ff4a32af0d7d372), UINT64_C(0x3ff4b17dea6db801),
        UINT64_C(0x3ff4bfdad53629e1), UINT64_C(0x3ff4ce41b817c132), UINT64_C(0x3ff4dcb299fddddb), UINT64_C(0x3ff4eb2d81d8ab96),
        UINT64_C(0x3ff4f9b2769d2d02), UINT64_C(0x3ff508417f4531c1), UINT64_C(0x3ff516daa2cf662a), UINT64_C(0x3ff5257de83f51ea),
        UINT64_C(0x3ff5342b569d4eda), UINT64_C(0x3ff542e2f4f6ac1a), UINT64_C(0x3ff551a4ca5d94db), UINT64_C(0x3ff56070dde9116b),
        UINT64_C(0x3ff56f4736b529de), UINT64_C(0x3ff57e27dbe2c40e), UINT64_C(0x3ff58d12d497c76f), UINT64_C(0x3ff59c0827ff0b4c),
        UINT64_C(0x3ff5ab07dd485427), UINT64_C(0x3ff5ba11fba87af4), UINT64_C(0x3ff5c9268a59460b), UINT64_C(0x3ff5d84590998e3f),
        UINT64_C(0x3ff5e76f15ad20e1), UINT64_C(0x3ff5f6a320dcebca), UINT64_C(0x3ff605e1b976dcb8), UINT64_C(0x3ff6152ae6cdf715),
        UINT64_C(0x3ff6247eb03a5531), UINT64_C(0x3ff633dd1d1929b5), UINT64_C(0x3ff6434634ccc313), UINT64_C(0x3ff652b9febc8efa),
        UINT64_C(0x3ff6623882553397), UINT64_C(0x3ff671c1c708328e), UINT64_C(0x3ff68155d44ca97e), UINT64_C(0x3ff690f4b19e9471)
    };
    static const uint32_t beside[AT_POWERS] = {
        0x3d398800u, 0x3cd80000u, 0xbd287800u, 0x3d1ec000u, 0xbcd80000u, 0xbcbc0000u, 0xbd2fd800u, 0xbd2c8800u,
        0x3d13c000u, 0xbd383000u, 0xbd00c000u, 0x3d2f8800u, 0x3d03e000u, 0xbd27d000u, 0xbcdd0000u, 0x3ce30000u,
        0xbced0000u, 0x3d204000u, 0x3ca00000u, 0xbd269000u, 0xbd02e000u, 0xbd245800u, 0x3d330000u, 0x3d0f0000u,
        0xbd21c000u, 0x3d29d000u, 0x3d471000u, 0x3d226000u, 0xbd32c400u, 0xbd230000u, 0xbd2a8000u, 0xbced0000u,
        0x3d332800u, 0x3d42b400u, 0xbd2ed000u, 0xbd205000u, 0x3d282800u, 0xbd1cb000u, 0xbd05e000u, 0x3cf54000u,
        0x3d172000u, 0xbd090000u, 0x3d256800u, 0xbd36d000u, 0xbd010000u, 0x3d2d0000u, 0xbd38a400u, 0x3d355c00u,
        0x3d26b800u, 0xbcec0000u, 0x3d17d000u, 0x3d164000u, 0xbcf50000u, 0x3d09e000u, 0x3d2ad800u, 0xbd1af000u,
        0x3d0b6000u, 0x3d388800u, 0x3d112000u, 0x3d06c000u, 0xbd29b800u, 0x3d2b7000u, 0x3cd90000u, 0x3ce40000u,
        0xbd2c9000u, 0x3d165000u, 0x3d2fd400u, 0x3d127000u, 0x3d4d4700u, 0xbd383800u, 0x3c980000u, 0x3d0ad000u,
        0x3cde8000u, 0xbd04c000u, 0xbd0d7000u, 0x3d0d9000u, 0x3d02a000u, 0xbd1f7800u, 0xbd10a000u, 0xbd114000u,
        0x3d0be000u, 0xbd094000u, 0xbd0ed000u, 0x3d396600u, 0xbd1a1000u, 0xbd584580u, 0xbd1a4800u, 0x3ccb0000u,
        0x3d014000u, 0x3cf02000u, 0x3cf36000u, 0xbd069000u, 0x3d09a000u, 0xbd15e000u, 0x3d1d2800u, 0x3d01a000u,
        0x3cdf0000u, 0xbd03a000u, 0xbd0cd800u, 0x3cf4c000u, 0x3cff9000u, 0x3ce98000u, 0xbcf52000u, 0xbd1d7000u,
        0xbd161400u, 0x3d0b4800u, 0x3d40ce00u, 0x3d0c6800u, 0xbd093000u, 0xbce50000u, 0xbd07f800u, 0xbcf37000u,
        0x3ce5d000u, 0x3d161a00u, 0x3cf55000u, 0x3cc64000u, 0xbcee8000u, 0xbcfa8800u, 0xbd2c9000u, 0x3caa0000u,
        0xbcf4f000u, 0x3cca8000u, 0x3cfabc00u, 0xbcd46000u, 0xbd0b0c00u, 0xbcc0e000u, 0xbd10de80u, 0x3cee4300u,
        0x00000000u, 0xbcb34000u, 0xbd121700u, 0x3cba4000u, 0x3cef9800u, 0xbcc74000u, 0x3cd83000u, 0xbd1a3f00u,
        0xbd028400u, 0x3cf16000u, 0x3d152400u, 0xbce9a000u, 0x3ce64000u, 0xbd007800u, 0xbc980000u, 0x3cffa000u,
        0xbcfac800u, 0x3cd9c000u, 0x3d052000u, 0xbcfad000u, 0x3d1bac00u, 0xbd04e800u, 0xbd0d3000u, 0x3cf15000u,
        0x3cec0000u, 0x3d16bc00u, 0x3ce84000u, 0xbd0ed000u, 0x3ce8e000u, 0x3ceb4000u, 0x3d053000u, 0x3d033800u,
        0x3d28d400u, 0xbd05d000u, 0xbd1c8800u, 0x3d11f000u, 0x3d104800u, 0xbd473900u, 0x3d24e400u, 0xbd0a2000u,
        0x3ce38000u, 0x3ceac000u, 0x3d019000u, 0xbd1b7800u, 0x3d2d9400u, 0x3cd80000u, 0x3d2b3400u, 0x3d19f800u,
        0xbd19c800u, 0x3d023000u, 0xbd134800u, 0x3d127000u, 0x3d11d000u, 0x3d31ee00u, 0xbd14c000u, 0xbd13d800u,
        0x3d08b000u, 0xbd227c00u, 0x3d2a3400u, 0xbd108000u, 0xbd0ed000u, 0xbcf42000u, 0xbd249800u, 0xbd163000u,
        0xbd323600u, 0xbd70df80u, 0xbd224800u, 0xbd259800u, 0x3d1ed000u, 0xbcdc0000u, 0xbd30d800u, 0x3d22c800u,
        0x3d206000u, 0xbd166000u, 0xbd0ae000u, 0xbd447200u, 0x3d082000u, 0x3d3e8000u, 0x3cef8000u, 0xbd17a000u,
        0x3d263000u, 0xbd48a600u, 0xbd3cdc00u, 0x3d25b800u, 0x3d1ec000u, 0xbd136000u, 0x3d239800u, 0x3cfa0000u,
        0xbcf6c000u, 0xbd0bc000u, 0xbd128000u, 0x3d30e000u, 0xbd2d4000u, 0x3d0c2000u, 0xbd1e5000u, 0x3d078000u,
        0xbd138000u, 0x3d008000u, 0x3d2c7000u, 0xbd1ce000u, 0x3d192000u, 0xbd08c000u, 0xbcfa0000u, 0x3d4a0800u,
        0xbd26d800u, 0xbd324400u, 0x3d483c00u, 0x3d24b000u, 0x3d415a00u, 0xbd29e000u, 0xbd230800u, 0x3d4dec00u,
        0xbcc40000u, 0x3d300800u, 0xbd26c800u, 0x3d469a00u, 0xbd1b4000u, 0x3d177000u, 0x3d26f800u, 0x3d010000u,
        0xbd15d000u, 0xbd12d000u, 0xbcea8000u, 0xbd286000u, 0x3d71fe00u, 0xbd372000u, 0x3ce68000u, 0xbd297800u
    };
    const double redux = at_number(UINT64_C(0x4338000000000000)) / 256.0;
    static const double p[5] = { 0x1.62e42fefa39efp-1, 0x1.ebfbdff82c575p-3, 0x1.c6b08d704a0a6p-5,
                                 0x1.3b2ab88f70400p-7, 0x1.5d88003875c74p-10 };
    const uint32_t high = at_high_word(of) & 0x7fffffffu;
    uint64_t bits;
    uint32_t place;
    int32_t k;
    double t;
    double z;
    if (isnan(of)) {
        return of;
    }
    if (of >= 1024.0) {
        return of * at_number(UINT64_C(0x7fe0000000000000));
    }
    if (of <= -1075.0) {
        return 0.0;
    }
    if (high < 0x3c900000u) {
        return 1.0 + of;
    }
    bits = at_bits(of + redux);
    place = (uint32_t)(bits & UINT64_C(0xffffffff)) + (AT_POWERS / 2u);
    k = (int32_t)(place >> 8) - (((place >> 31) != 0u) ? 16777216 : 0);
    place = place % AT_POWERS;
    t = at_number(powers[place]);
    z = (of - (at_number(bits) - redux)) - at_number((uint64_t)beside[place] << 32);
    return at_scaled(t + ((t * z) * at_polynomial(p, 5, z)), k);
}

/* x^y, after e_pow.c:
 *
 * Copyright (C) 2004 by Sun Microsystems, Inc. All rights reserved.
 * Permission to use, copy, modify, and distribute this software is freely granted, provided that this notice is preserved.
 */

/* The logarithm of a size to base 2, as the sum of two numbers. */
typedef struct {
    double high;
    double low;
} at_two;

/* Of a size within 2^-20 of 1. */
static at_two at_log2_near_one(double size)
{
    const double inverse_ln2 = 1.44269504088896338700e+00;
    const double inverse_ln2_high = 1.44269502162933349609e+00;
    const double inverse_ln2_low = 1.92596299112661746887e-08;
    const double t = size - 1.0;
    const double w = (t * t) * (0.5 - (t * (0.3333333333333333333333 - (t * 0.25))));
    const double u = inverse_ln2_high * t;
    const double v = (t * inverse_ln2_low) - (w * inverse_ln2);
    at_two log2;
    log2.high = at_without_low_word(u + v);
    log2.low = v - (log2.high - u);
    return log2;
}

static at_two at_log2(double size)
{
    static const double l[6] = { 5.99999999999994648725e-01, 4.28571428578550184252e-01, 3.33333329818377432918e-01,
                                 2.72728123808534006489e-01, 2.30660745775561754067e-01, 2.06975017800338417784e-01 };
    const double cp = 9.61796693925975554329e-01;
    const double cp_high = 9.61796700954437255859e-01;
    const double cp_low = -7.02846165095275826516e-09;
    double ax = size;
    double base = 1.0;
    double base_high = 0.0;
    double base_low = 0.0;
    uint32_t ix = at_high_word(ax);
    uint32_t rest;
    uint32_t k = 0u;
    int32_t n = 0;
    double u;
    double v;
    double ss;
    double s_h;
    double s_l;
    double t_h;
    double t_l;
    double s2;
    double r;
    double p_h;
    double p_l;
    double z_h;
    double z_l;
    double t;
    at_two log2;
    if (ix < 0x00100000u) {
        ax = ax * 9007199254740992.0;
        n = -53;
        ix = at_high_word(ax);
    }
    n += (int32_t)(ix >> 20) - 0x3ff;
    rest = ix & 0x000fffffu;
    ix = rest | 0x3ff00000u;
    if (rest <= 0x3988Eu) {
        k = 0u;
    } else if (rest < 0xBB67Au) {
        k = 1u;
        base = 1.5;
        base_high = 5.84962487220764160156e-01;
        base_low = 1.35003920212974897128e-08;
    } else {
        n++;
        ix -= 0x00100000u;
    }
    ax = at_with_high_word(ax, ix);
    u = ax - base;
    v = 1.0 / (ax + base);
    ss = u * v;
    s_h = at_without_low_word(ss);
    t_h = at_with_high_word(0.0, (((ix >> 1) | 0x20000000u) + 0x00080000u) + (k << 18));
    t_l = ax - (t_h - base);
    s_l = v * ((u - (s_h * t_h)) - (s_h * t_l));
    s2 = ss * ss;
    r = (s2 * s2) * at_polynomial(l, 6, s2);
    r = r + (s_l * (s_h + ss));
    s2 = s_h * s_h;
    t_h = at_without_low_word((3.0 + s2) + r);
    t_l = r - ((t_h - 3.0) - s2);
    u = s_h * t_h;
    v = (s_l * t_h) + (t_l * ss);
    p_h = at_without_low_word(u + v);
    p_l = v - (p_h - u);
    z_h = cp_high * p_h;
    z_l = ((cp_low * p_h) + (p_l * cp)) + base_low;
    t = (double)n;
    log2.high = at_without_low_word(((z_h + z_l) + base_high) + t);
    log2.low = z_l - (((log2.high - t) - base_high) - z_h);
    return log2;
}

/* 2^(p_h + p_l), of which z is the sum. */
static double at_exp2_of_two(double z, double p_h, double p_l)
{
    const double lg2 = 6.93147180559945286227e-01;
    const double lg2_high = 6.93147182464599609375e-01;
    const double lg2_low = -1.90465429995776804525e-09;
    const uint32_t word = at_high_word(z);
    const uint32_t size = word & 0x7fffffffu;
    double high = p_h;
    double t;
    double u;
    double v;
    double w;
    double y;
    double t1;
    double r;
    int32_t n = 0;
    int32_t j;
    if (size > 0x3fe00000u) {
        const uint32_t rounded = word + (0x00100000u >> ((size >> 20) - 0x3feu));
        const uint32_t k = ((rounded & 0x7fffffffu) >> 20) - 0x3ffu;
        t = at_with_high_word(0.0, rounded & ~(0x000fffffu >> k));
        n = (int32_t)(((rounded & 0x000fffffu) | 0x00100000u) >> (20u - k));
        if ((word >> 31) != 0u) {
            n = -n;
        }
        high = high - t;
    }
    t = at_without_low_word(p_l + high);
    u = t * lg2_high;
    v = ((p_l - (t - high)) * lg2) + (t * lg2_low);
    y = u + v;
    w = v - (y - u);
    t = y * y;
    t1 = y - (t * at_polynomial(at_of_exp, 5, t));
    r = ((y * t1) / (t1 - 2.0)) - (w + (y * w));
    y = 1.0 - (r - y);
    j = (int32_t)at_high_word(y) + (n * 0x00100000);
    return (j < 0x00100000) ? at_scaled(y, n) : at_with_high_word(y, (uint32_t)j);
}

#define AT_NO_INTEGER 0
#define AT_ODD 1
#define AT_EVEN 2

static int at_parity(double y)
{
    const double size = fabs(y);
    int parity = AT_NO_INTEGER;
    if (size >= 9007199254740992.0) {
        parity = AT_EVEN;
    } else if (floor(size) == size) {
        parity = (floor(0.5 * size) == (0.5 * size)) ? AT_EVEN : AT_ODD;
    } else {
        /* It is none. */
    }
    return parity;
}

/* The power of a size that is neither 0, 1 nor infinite, to a finite y. */
static double at_pow_of_size(double size, double y)
{
    /* -(1024 - log2(the largest number + half of its last digit)). */
    const double overflow = 8.0085662595372944372e-017;
    const uint32_t of_size = at_high_word(size);
    const uint32_t of_y = at_high_word(fabs(y));
    const double y1 = at_without_low_word(y);
    at_two log2;
    double p_h;
    double p_l;
    double z;
    if ((of_y > 0x41e00000u)
        && ((of_y > 0x43f00000u) || (of_size < 0x3fefffffu) || (of_size > 0x3ff00000u))) {
        return ((of_size < 0x3ff00000u) == (y < 0.0)) ? (double)INFINITY : 0.0;
    }
    log2 = (of_y > 0x41e00000u) ? at_log2_near_one(size) : at_log2(size);
    p_l = ((y - y1) * log2.high) + (y * log2.low);
    p_h = y1 * log2.high;
    z = p_l + p_h;
    if (z >= 1024.0) {
        if ((z > 1024.0) || ((p_l + overflow) > (z - p_h))) {
            return (double)INFINITY;
        }
    } else if (z <= -1075.0) {
        if ((z < -1075.0) || (p_l <= (z - p_h))) {
            return 0.0;
        }
    } else {
        /* It is a number. */
    }
    return at_exp2_of_two(z, p_h, p_l);
}

static double at_pow(double x, double y)
{
    const double size = fabs(x);
    const int parity = (signbit(x) != 0) ? at_parity(y) : AT_EVEN;
    double power;
    if ((y == 0.0) || (x == 1.0)) {
        power = 1.0;
    } else if (isnan(x) || isnan(y)) {
        power = x + y;
    } else if (isinf(y)) {
        if (size == 1.0) {
            power = 1.0;
        } else {
            power = ((size > 1.0) == (y > 0.0)) ? (double)INFINITY : 0.0;
        }
    } else if (y == 1.0) {
        power = x;
    } else if ((y == -1.0) && (size > 0.0)) {
        power = 1.0 / x;
    } else if (y == 2.0) {
        power = x * x;
    } else if ((y == 0.5) && (signbit(x) == 0)) {
        power = sqrt(x);
    } else if ((parity == AT_NO_INTEGER) && (x < 0.0) && (isinf(x) == 0)) {
        power = (double)NAN;
    } else if ((size == 0.0) || (size == 1.0) || (isinf(size) != 0)) {
        power = size;
        if (y < 0.0) {
            power = (size == 0.0) ? (double)INFINITY : (1.0 / size);
        }
        power = (parity == AT_ODD) ? -power : power;
    } else {
        power = at_pow_of_size(size, y);
        power = (parity == AT_ODD) ? -power : power;
    }
    return power;
}

/* ---- Slots: what every channel was given last, with which stamp, and at which tick. */

static at_real at_value(const at_plan *p, at_memory m, int32_t slot)
{
    return m.r[p->slot_reals + slot];
}

static int64_t at_stamp(const at_plan *p, at_memory m, int32_t slot)
{
    return m.i[p->slot_ints + slot];
}

static int at_ran(const at_plan *p, at_memory m, int32_t slot)
{
    return (m.i[p->slot_ints + p->slots + slot] == m.i[AT_TICK]) ? 1 : 0;
}

static int at_is_fresh(const at_plan *p, at_memory m, int32_t slot)
{
    return ((at_ran(p, m, slot) != 0) && (at_is_absent(at_value(p, m, slot)) == 0)) ? 1 : 0;
}

static void at_put(const at_plan *p, at_memory m, int32_t slot, at_real value, int64_t stamp)
{
    m.r[p->slot_reals + slot] = value;
    m.i[p->slot_ints + slot] = stamp;
    m.i[p->slot_ints + p->slots + slot] = m.i[AT_TICK];
}

static void at_give(const at_plan *p, at_memory m, int32_t slot, at_real value, int64_t stamp)
{
    at_put(p, m, slot, at_unless_infinite(value), stamp);
}

/* ---- Histories. Of integers: where the oldest lies, how many there are, instants, stamps. */

static int32_t at_place(const at_history *h, at_memory m, int64_t nth)
{
    int64_t place = m.i[h->ints] + nth;
    if (place >= (int64_t)h->room) {
        place -= (int64_t)h->room;
    }
    return (int32_t)place;
}

static void at_drop_oldest(const at_history *h, at_memory m)
{
    m.i[h->ints] = (int64_t)at_place(h, m, 1);
    m.i[h->ints + 1]--;
}

static void at_write(const at_history *h, at_memory m, int64_t now, at_real value, int64_t stamp)
{
    int32_t place;
    const int64_t before = at_minus(now, h->depth);
    while ((m.i[h->ints + 1] > 1) && (m.i[h->ints + 2 + at_place(h, m, 1)] <= before)) {
        at_drop_oldest(h, m);
    }
    if (m.i[h->ints + 1] >= (int64_t)h->room) {
        at_drop_oldest(h, m);
        m.i[AT_FLAGS] |= (int64_t)AT_FULL;
    }
    place = at_place(h, m, m.i[h->ints + 1]);
    m.i[h->ints + 2 + place] = now;
    if (h->stamped != 0) {
        m.i[h->ints + 2 + h->room + place] = stamp;
    }
    m.r[h->reals + place] = value;
    m.i[h->ints + 1]++;
}

/* What was held at an instant, unless it was too old then. */
static at_real at_past(const at_history *h, at_memory m, int64_t at, int64_t max_age, int64_t *stamp)
{
    int64_t low = 0;
    int64_t high = m.i[h->ints + 1];
    at_real value = AT_NAN;
    *stamp = at;
    while (low < high) {
        const int64_t middle = low + ((high - low) / 2);
        if (m.i[h->ints + 2 + at_place(h, m, middle)] <= at) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    if (low > 0) {
        const int32_t place = at_place(h, m, low - 1);
        *stamp = m.i[h->ints + 2 + ((h->stamped != 0) ? h->room : 0) + place];
        value = m.r[h->reals + place];
        if (at > at_plus(*stamp, max_age)) {
            value = AT_NAN;
        }
    }
    return value;
}

/* ---- Reading. */

static at_real at_read(const at_plan *p, at_memory m, const at_entry *e, int32_t held, int64_t *stamp)
{
    at_real value;
    const int64_t now = m.i[AT_LAST];
    if (e->history >= 0) {
        value = at_past(&p->history[e->history], m, at_minus(now, e->lag), e->max_age, stamp);
        *stamp = at_plus(*stamp, e->lag);
    } else {
        value = at_value(p, m, e->slot);
        *stamp = at_stamp(p, m, e->slot);
        if (held == 0) {
            if (at_ran(p, m, e->slot) == 0) {
                value = AT_NAN;
            }
        } else if (at_minus(now, *stamp) > e->max_age) {
            value = AT_NAN;
        } else {
            /* It counts. */
        }
    }
    if (at_minus(now, *stamp) <= e->spared) {
        *stamp = now;
    }
    return value * e->factor;
}

static const at_entry *at_entry_of(const at_plan *p, int32_t gather, int32_t nth)
{
    return &p->entry[p->gather[gather].first + nth];
}

static at_real at_port(const at_plan *p, at_memory m, int32_t gather, int32_t nth, int64_t *stamp)
{
    return at_read(p, m, at_entry_of(p, gather, nth), p->gather[gather].held, stamp);
}

/* The value of a port of one channel for all, or of one for each; NaN and `there` 0 where the port has none. */
static at_real at_port_for(const at_plan *p, at_memory m, int32_t gather, int32_t nth, int *there)
{
    const int32_t count = p->gather[gather].count;
    const int32_t place = (count == 1) ? 0 : nth;
    int64_t stamp;
    *there = (place < count) ? 1 : 0;
    return (place < count) ? at_port(p, m, gather, place, &stamp) : AT_NAN;
}

#define AT_FRESH 1
#define AT_ENDED 2

static void at_look(const at_plan *p, at_memory m, int32_t gather)
{
    const at_gather *g = &p->gather[gather];
    int64_t found = 0;
    int32_t nth;
    for (nth = 0; nth < g->count; nth++) {
        const at_entry *e = &p->entry[g->first + nth];
        if ((e->history < 0) && (at_ran(p, m, e->slot) != 0)) {
            if (at_is_absent(at_value(p, m, e->slot)) == 0) {
                found |= AT_FRESH;
            } else if (g->held != 0) {
                found |= AT_ENDED;
            } else {
                /* Nothing new. */
            }
        }
    }
    m.i[p->gather_ints + gather] = found;
}

static int at_gather_is(const at_plan *p, at_memory m, int32_t gather, int64_t what)
{
    return ((m.i[p->gather_ints + gather] & what) != 0) ? 1 : 0;
}

/* The oldest stamp among the values of a gather that are there; `newest` where there is none. */
static int64_t at_oldest(const at_plan *p, at_memory m, int32_t gather, int64_t newest)
{
    int64_t oldest = INT64_MAX;
    int any = 0;
    int32_t nth;
    for (nth = 0; nth < p->gather[gather].count; nth++) {
        int64_t stamp;
        if (at_is_absent(at_port(p, m, gather, nth, &stamp)) == 0) {
            any = 1;
            if (stamp < oldest) {
                oldest = stamp;
            }
        }
    }
    return (any != 0) ? oldest : newest;
}

/* ---- Slopes. Rows are cut into blocks of at most 64; a window is the end of one block, all blocks after it and the current one.
 * Of integers: how many rows there were, the first after the last that lacks a sample, rows until origins are chosen anew, rows at
 * which they still are, the number of blocks; the first rows of blocks, the oldest row of each window; of each channel whether it has
 * begun, its first and its newest sample's time; the times of rows. Of numbers: the origin of each channel, the samples. */

#define AT_ROWS 0
#define AT_COMPLETE_FROM 1
#define AT_UNTIL_REBASE 2
#define AT_SETTLING 3
#define AT_BLOCKS 4
#define AT_STARTS 5

#define AT_MOST_ROWS 64
#define AT_FEWEST_ROWS 8
#define AT_REBASE_ROWS 8192
#define AT_REBASE_TIMES 4
#define AT_SETTLING_ROWS 5
#define AT_THIN AT_R(1.0e-4)
#define AT_NEWEST 5

static int32_t at_heads(const at_slope *s)
{
    return s->ints + AT_STARTS + s->blocks;
}

static int32_t at_channels(const at_slope *s)
{
    return at_heads(s) + s->windows;
}

static int32_t at_row_place(const at_slope *s, int64_t row)
{
    return (int32_t)(row % (int64_t)s->room);
}

static int64_t at_row_time(const at_slope *s, at_memory m, int64_t row)
{
    return m.i[at_channels(s) + (3 * s->channels) + at_row_place(s, row)];
}

static const at_real *at_row(const at_slope *s, at_memory m, int64_t row)
{
    return &m.r[s->reals + s->channels + (at_row_place(s, row) * s->channels)];
}

/* Lets the oldest row of a window be the first that is within it when it ends at `now`. */
static void at_advance(const at_slope *s, at_memory m, int32_t window, int64_t now)
{
    int64_t *head = &m.i[at_heads(s) + window];
    const int64_t rows = m.i[s->ints + AT_ROWS];
    if ((rows - *head) > (int64_t)s->room) {
        *head = rows - (int64_t)s->room;
        m.i[AT_FLAGS] |= (int64_t)AT_FULL;
    }
    while ((*head < rows) && (at_minus(now, at_row_time(s, m, *head)) >= s->width[window])) {
        (*head)++;
    }
}

static int at_before(at_real a, at_real b)
{
    return ((a < b) || ((a == b) && (signbit(a) != 0) && (signbit(b) == 0))) ? 1 : 0;
}

static void at_sort(at_real values[], int32_t count)
{
    int32_t nth;
    for (nth = 1; nth < count; nth++) {
        const at_real value = values[nth];
        int32_t place = nth;
        while ((place > 0) && (at_before(value, values[place - 1]) != 0)) {
            values[place] = values[place - 1];
            place--;
        }
        values[place] = value;
    }
}

/* The origin of a channel is the median of its newest samples. */
static void at_choose_origins(const at_slope *s, at_memory m)
{
    const int64_t rows = m.i[s->ints + AT_ROWS];
    int64_t oldest = m.i[s->ints + AT_STARTS];
    int32_t channel;
    if (oldest < (rows - AT_MOST_ROWS)) {
        oldest = rows - AT_MOST_ROWS;
    }
    for (channel = 0; channel < s->channels; channel++) {
        at_real newest[AT_NEWEST];
        int32_t found = 0;
        int64_t row = rows;
        while ((row > oldest) && (found < AT_NEWEST)) {
            at_real y;
            row--;
            y = at_row(s, m, row)[channel];
            if (at_is_absent(y) == 0) {
                newest[found] = y;
                found++;
            }
        }
        if (found > 0) {
            at_sort(newest, found);
            m.r[s->reals + channel] = newest[found / 2];
        }
    }
}

/* The block of a row. */
static int64_t at_block_of(const at_slope *s, at_memory m, int64_t row)
{
    int64_t block = m.i[s->ints + AT_BLOCKS] - 1;
    while ((block > 0) && (m.i[s->ints + AT_STARTS + block] > row)) {
        block--;
    }
    return block;
}

static void at_forget_blocks(const at_slope *s, at_memory m, int64_t forgotten)
{
    int64_t *starts = &m.i[s->ints + AT_STARTS];
    int64_t nth;
    m.i[s->ints + AT_BLOCKS] -= forgotten;
    for (nth = 0; nth < m.i[s->ints + AT_BLOCKS]; nth++) {
        starts[nth] = starts[nth + forgotten];
    }
}

/* Begins a block with the next row; whether origins were chosen anew. */
static int at_close_block(const at_slope *s, at_memory m, int64_t now)
{
    int anew = 0;
    const int64_t rows = m.i[s->ints + AT_ROWS];
    int64_t oldest;
    int32_t window;
    if (m.i[s->ints + AT_BLOCKS] >= (int64_t)s->blocks) {
        at_forget_blocks(s, m, 1);
        m.i[AT_FLAGS] |= (int64_t)AT_FULL;
    }
    m.i[s->ints + AT_STARTS + m.i[s->ints + AT_BLOCKS]] = rows;
    m.i[s->ints + AT_BLOCKS]++;
    oldest = m.i[s->ints + AT_BLOCKS] - 1;
    for (window = 0; window < s->windows; window++) {
        int64_t block;
        at_advance(s, m, window, now);
        block = at_block_of(s, m, m.i[at_heads(s) + window]);
        if (block < oldest) {
            oldest = block;
        }
    }
    at_forget_blocks(s, m, oldest);
    if (m.i[s->ints + AT_UNTIL_REBASE] == 0) {
        const int64_t kept = AT_REBASE_TIMES * (rows - m.i[s->ints + AT_STARTS]);
        m.i[s->ints + AT_UNTIL_REBASE] = (kept > AT_REBASE_ROWS) ? kept : AT_REBASE_ROWS;
        at_choose_origins(s, m);
        anew = 1;
    }
    return anew;
}

/* Adds the row of this tick; whether origins were chosen anew, so that all sums are others. */
static int at_push(const at_plan *p, const at_slope *s, at_memory m)
{
    int anew = 0;
    const int64_t now = m.i[AT_LAST];
    const int64_t row = m.i[s->ints + AT_ROWS];
    const int64_t start = m.i[s->ints + AT_STARTS + m.i[s->ints + AT_BLOCKS] - 1];
    const int32_t of_channels = at_channels(s);
    at_real *samples = &m.r[s->reals + s->channels + (at_row_place(s, row) * s->channels)];
    int begun = 0;
    int absent = 0;
    int32_t channel;
    int32_t window;
    at_advance(s, m, s->order[0], now);
    if (((row - start) >= AT_MOST_ROWS)
        || (((row - start) >= AT_FEWEST_ROWS) && (m.i[at_heads(s) + s->order[0]] > start))) {
        anew = at_close_block(s, m, now);
    }
    m.i[of_channels + (3 * s->channels) + at_row_place(s, row)] = now;
    for (channel = 0; channel < s->channels; channel++) {
        int64_t stamp;
        const at_real y = at_port(p, m, s->gather, channel, &stamp);
        if (at_size(y) < AT_LIMIT) {
            samples[channel] = y;
            if (m.i[of_channels + channel] == 0) {
                m.i[of_channels + channel] = 1;
                m.i[of_channels + s->channels + channel] = now;
                begun = 1;
            }
            m.i[of_channels + (2 * s->channels) + channel] = now;
        } else {
            samples[channel] = AT_NAN;
            absent = 1;
        }
    }
    m.i[s->ints + AT_ROWS] = row + 1;
    if (absent != 0) {
        m.i[s->ints + AT_COMPLETE_FROM] = row + 1;
    }
    if (m.i[s->ints + AT_UNTIL_REBASE] > 0) {
        m.i[s->ints + AT_UNTIL_REBASE]--;
    }
    if (begun != 0) {
        m.i[s->ints + AT_UNTIL_REBASE] = AT_MOST_ROWS;
        m.i[s->ints + AT_SETTLING] = AT_SETTLING_ROWS;
    }
    if (m.i[s->ints + AT_SETTLING] > 0) {
        m.i[s->ints + AT_SETTLING]--;
        at_choose_origins(s, m);
        anew = 1;
    }
    for (window = 0; window < s->windows; window++) {
        at_advance(s, m, window, now);
    }
    return anew;
}

/* Sums over a run of rows: of all rows 1, t and t squared; by channel y, t y, and the three of its own rows. */
typedef struct {
    at_real n;
    at_real t;
    at_real tt;
    at_real *of;
} at_sums;

#define AT_SUMS 5

static void at_clear(at_sums *sums, int32_t channels)
{
    int32_t nth;
    sums->n = AT_R(0.0);
    sums->t = AT_R(0.0);
    sums->tt = AT_R(0.0);
    for (nth = 0; nth < (AT_SUMS * channels); nth++) {
        sums->of[nth] = AT_R(0.0);
    }
}

static void at_add_row(const at_slope *s, at_memory m, at_sums *sums, int64_t row, int64_t origin, int gaps)
{
    const at_real *samples = at_row(s, m, row);
    const at_real t = (at_real)at_minus(at_row_time(s, m, row), origin);
    const at_real tt = t * t;
    int32_t channel;
    sums->n = sums->n + AT_R(1.0);
    sums->t = sums->t + t;
    sums->tt = sums->tt + tt;
    for (channel = 0; channel < s->channels; channel++) {
        at_real *of = &sums->of[AT_SUMS * channel];
        const at_real y = samples[channel] - m.r[s->reals + channel];
        /* Of a sample that is absent nothing is added, and of zero there is nothing that changes. */
        if (at_is_absent(y) == 0) {
            of[0] = of[0] + y;
            of[1] = of[1] + (t * y);
            if (gaps != 0) {
                of[2] = of[2] + AT_R(1.0);
                of[3] = of[3] + t;
                of[4] = of[4] + tt;
            }
        }
    }
}

static void at_add_shifted(const at_slope *s, at_sums *sums, const at_sums *other, at_real by, int gaps)
{
    int32_t channel;
    sums->n = sums->n + other->n;
    sums->tt = sums->tt + (other->tt + (by * ((AT_R(2.0) * other->t) + (by * other->n))));
    sums->t = sums->t + (other->t + (by * other->n));
    for (channel = 0; channel < s->channels; channel++) {
        at_real *of = &sums->of[AT_SUMS * channel];
        const at_real *from = &other->of[AT_SUMS * channel];
        of[0] = of[0] + from[0];
        of[1] = of[1] + (from[1] + (by * from[0]));
        if (gaps != 0) {
            of[2] = of[2] + from[2];
            of[4] = of[4] + (from[4] + (by * ((AT_R(2.0) * from[3]) + (by * from[2]))));
            of[3] = of[3] + (from[3] + (by * from[2]));
        }
    }
}

/* The slope per second from the samples themselves, where sums have lost too many digits. */
static at_real at_line(const at_slope *s, at_memory m, int64_t head, int32_t channel)
{
    const int64_t rows = m.i[s->ints + AT_ROWS];
    const int64_t begin = at_row_time(s, m, head);
    const at_real origin = m.r[s->reals + channel];
    at_real n = AT_R(0.0);
    at_real mean_t = AT_R(-0.0);
    at_real mean_y = AT_R(-0.0);
    at_real sxx = AT_R(0.0);
    at_real sxy = AT_R(0.0);
    int64_t row;
    for (row = head; row < rows; row++) {
        const at_real y = at_row(s, m, row)[channel] - origin;
        if (at_is_absent(y) == 0) {
            n = n + AT_R(1.0);
            mean_t = mean_t + (at_real)at_minus(at_row_time(s, m, row), begin);
            mean_y = mean_y + y;
        }
    }
    mean_t = at_over(mean_t, n);
    mean_y = at_over(mean_y, n);
    for (row = head; row < rows; row++) {
        const at_real y = (at_row(s, m, row)[channel] - origin) - mean_y;
        if (at_is_absent(y) == 0) {
            const at_real t = (at_real)at_minus(at_row_time(s, m, row), begin) - mean_t;
            sxx = sxx + (t * t);
            sxy = sxy + (t * y);
        }
    }
    return at_over(sxy, sxx) * AT_R(1.0e9);
}

/* Nanoseconds that the samples of a channel span within a window; below 0 where it has none. */
static at_real at_span(const at_slope *s, at_memory m, int64_t head, int32_t channel)
{
    const int64_t rows = m.i[s->ints + AT_ROWS];
    const int64_t now = m.i[AT_LAST];
    const int64_t begin = at_row_time(s, m, head);
    at_real span = AT_R(-1.0);
    int64_t row = head;
    while ((row < rows) && (at_is_absent(at_row(s, m, row)[channel]) != 0)) {
        row++;
    }
    if (row < rows) {
        const int64_t silent = at_minus(now, m.i[at_channels(s) + (2 * s->channels) + channel]);
        const int64_t wait = at_minus(at_row_time(s, m, row), begin);
        span = ((at_real)at_minus(now, begin) - (at_real)silent) - (at_real)wait;
    }
    return span;
}

/* Gives the slopes in a window, of channels that have a new sample. */
static void at_finish(const at_plan *p, const at_slope *s, at_memory m, int32_t window, const at_sums *head,
                      const at_sums *rest, const at_sums *now, at_real by)
{
    const int64_t at = m.i[AT_LAST];
    const int64_t first = m.i[at_heads(s) + window];
    const int64_t rows = m.i[s->ints + AT_ROWS];
    const int gaps = (first < m.i[s->ints + AT_COMPLETE_FROM]) ? 1 : 0;
    const int none = (((rows - first) < s->min_samples)
                      || (at_minus(at, at_row_time(s, m, first)) < s->needed_span[window]))
                         ? 1
                         : 0;
    int32_t channel;
    for (channel = 0; channel < s->channels; channel++) {
        const int32_t place = (channel * s->windows) + window;
        const at_real *h = &head->of[AT_SUMS * channel];
        const at_real *r = &rest->of[AT_SUMS * channel];
        const at_real *w = &now->of[AT_SUMS * channel];
        at_real slope = AT_NAN;
        if (at_is_fresh(p, m, at_entry_of(p, s->gather, channel)->slot) == 0) {
            continue;
        }
        if (none == 0) {
            at_real n = (rest->n + now->n) + head->n;
            at_real t = (rest->t + now->t) + (head->t + (by * head->n));
            at_real tt = (rest->tt + now->tt) + (head->tt + (by * ((AT_R(2.0) * head->t) + (by * head->n))));
            at_real scale;
            at_real of_ty;
            at_real of_y;
            at_real of_head_y;
            if (gaps != 0) {
                n = (r[2] + w[2]) + h[2];
                t = (r[3] + w[3]) + (h[3] + (by * h[2]));
                tt = (r[4] + w[4]) + (h[4] + (by * ((AT_R(2.0) * h[3]) + (by * h[2]))));
            }
            scale = at_over(AT_R(1.0e9), (n * tt) - (t * t));
            of_ty = n * scale;
            of_y = t * scale;
            of_head_y = of_y - (of_ty * by);
            slope = ((of_ty * (h[1] + (r[1] + w[1]))) - (of_y * (r[0] + w[0]))) - (of_head_y * h[0]);
            if (gaps != 0) {
                if (((n * tt) - (t * t)) < (AT_THIN * (n * tt))) {
                    slope = at_line(s, m, first, channel);
                }
                if ((n < (at_real)s->min_samples)
                    || (at_span(s, m, first, channel) < (at_real)s->needed_span[window])) {
                    slope = AT_NAN;
                }
            }
        }
        if ((m.i[at_channels(s) + channel] != 0)
            && (at_minus(at, m.i[at_channels(s) + s->channels + channel]) < s->needed_open[window])) {
            slope = AT_NAN;
        }
        at_put(p, m, s->slot + place, slope * s->factors[place], at);
    }
}

/* ---- Sums that are kept: of the current block all rows, then of closed blocks each eighth row's from the end of its block, then by block all
 * rows, and all closed blocks after it. So a tick adds at most seven rows for each window, in the order of all of them. */

#define AT_EACH 8

static int32_t at_kept_width(const at_slope *s)
{
    return 3 + (AT_SUMS * s->channels);
}

static int64_t at_kept_slots(const at_slope *s)
{
    return ((int64_t)s->room / AT_EACH) + 2;
}

/* Where the sums from a row on are, which is an eighth one of its block. */
static at_real *at_tail_at(const at_slope *s, at_memory m, int64_t row)
{
    const int64_t slot = 1 + ((row / AT_EACH) % at_kept_slots(s));
    return &m.r[s->kept + (int32_t)(slot * (int64_t)at_kept_width(s))];
}

/* Where the sums of a block are, with those of the closed blocks after it behind them. No block has fewer rows than lie between two places. */
static at_real *at_whole_at(const at_slope *s, at_memory m, int64_t start)
{
    const int64_t slot = (1 + at_kept_slots(s)) + (2 * ((start / AT_EACH) % at_kept_slots(s)));
    return &m.r[s->kept + (int32_t)(slot * (int64_t)at_kept_width(s))];
}

static void at_keep(const at_slope *s, at_real place[], const at_sums *sums)
{
    int32_t nth;
    place[0] = sums->n;
    place[1] = sums->t;
    place[2] = sums->tt;
    for (nth = 0; nth < (AT_SUMS * s->channels); nth++) {
        place[3 + nth] = sums->of[nth];
    }
}

/* Sums where they lie. */
static at_sums at_kept_at(at_real place[])
{
    at_sums sums;
    sums.n = place[0];
    sums.t = place[1];
    sums.tt = place[2];
    sums.of = &place[3];
    return sums;
}

/* Sums a closed block, the newest row first. */
static void at_sum_block(const at_plan *p, const at_slope *s, at_memory m, int64_t block)
{
    const int64_t first = m.i[s->ints + AT_STARTS + block];
    const int64_t end = m.i[s->ints + AT_STARTS + block + 1];
    const int64_t last = at_row_time(s, m, end - 1);
    at_sums tail = at_kept_at(&m.r[p->scratch]);
    int64_t row;
    at_clear(&tail, s->channels);
    for (row = end - 1; row >= first; row--) {
        at_add_row(s, m, &tail, row, last, 1);
        if (((end - row) % AT_EACH) == 0) {
            at_keep(s, at_tail_at(s, m, row), &tail);
        }
    }
    at_keep(s, at_whole_at(s, m, first), &tail);
}

/* Of each block sums the closed ones after it, about the time of the first row of the current one. */
static void at_sum_rest(const at_plan *p, const at_slope *s, at_memory m)
{
    const int64_t *starts = &m.i[s->ints + AT_STARTS];
    const int64_t current = m.i[s->ints + AT_BLOCKS] - 1;
    const int64_t origin = at_row_time(s, m, starts[current]);
    at_sums rest = at_kept_at(&m.r[p->scratch]);
    int64_t block;
    at_clear(&rest, s->channels);
    for (block = current - 1; block >= 0; block--) {
        at_real *place = at_whole_at(s, m, starts[block]);
        const at_sums whole = at_kept_at(place);
        at_keep(s, &place[at_kept_width(s)], &rest);
        at_add_shifted(s, &rest, &whole, (at_real)at_minus(at_row_time(s, m, starts[block + 1] - 1), origin), 1);
    }
}

/* Sums the rows of the current block from one on. */
static void at_sum_now(const at_slope *s, at_memory m, int64_t from)
{
    const int64_t current = m.i[s->ints + AT_STARTS + m.i[s->ints + AT_BLOCKS] - 1];
    at_real *place = &m.r[s->kept];
    at_sums now = at_kept_at(place);
    int64_t row;
    if (from == current) {
        at_clear(&now, s->channels);
    }
    for (row = from; row < m.i[s->ints + AT_ROWS]; row++) {
        at_add_row(s, m, &now, row, at_row_time(s, m, current), 1);
    }
    place[0] = now.n;
    place[1] = now.t;
    place[2] = now.tt;
}

/* Makes all sums of the rows, after origins have been chosen anew or a state was loaded. */
static void at_rebuild(const at_plan *p, const at_slope *s, at_memory m)
{
    const int64_t current = m.i[s->ints + AT_BLOCKS] - 1;
    int64_t block;
    for (block = 0; block < current; block++) {
        at_sum_block(p, s, m, block);
    }
    at_sum_rest(p, s, m);
    at_sum_now(s, m, m.i[s->ints + AT_STARTS + current]);
}

static void at_run_fast(const at_plan *p, const at_slope *s, at_memory m, int anew)
{
    const int64_t rows = m.i[s->ints + AT_ROWS];
    const int64_t *starts = &m.i[s->ints + AT_STARTS];
    int64_t block = m.i[s->ints + AT_BLOCKS] - 1;
    const int64_t current = starts[block];
    const int64_t origin = at_row_time(s, m, current);
    const int gaps = (m.i[at_heads(s) + s->order[s->windows - 1]] < m.i[s->ints + AT_COMPLETE_FROM]) ? 1 : 0;
    at_sums now;
    at_sums tail = at_kept_at(&m.r[p->scratch]);
    at_sums none = at_kept_at(&m.r[p->scratch + at_kept_width(s)]);
    int32_t nth;
    int64_t row;
    if (anew != 0) {
        at_rebuild(p, s, m);
    } else {
        if ((current == (rows - 1)) && (block > 0)) {
            at_sum_block(p, s, m, block - 1);
            at_sum_rest(p, s, m);
        }
        at_sum_now(s, m, rows - 1);
    }
    now = at_kept_at(&m.r[s->kept]);
    at_clear(&none, s->channels);
    for (nth = 0; nth < s->windows; nth++) {
        const int64_t head = m.i[at_heads(s) + s->order[nth]];
        at_clear(&tail, s->channels);
        if (head == current) {
            at_finish(p, s, m, s->order[nth], &none, &none, &now, AT_R(0.0));
        } else if (head > current) {
            for (row = head; row < rows; row++) {
                at_add_row(s, m, &tail, row, at_row_time(s, m, head), gaps);
            }
            at_finish(p, s, m, s->order[nth], &none, &none, &tail, AT_R(0.0));
        } else {
            int64_t end;
            int64_t last;
            int64_t from;
            at_sums rest;
            while ((block > 0) && (starts[block] > head)) {
                block--;
            }
            end = starts[block + 1];
            last = at_row_time(s, m, end - 1);
            from = end - (((end - head) / AT_EACH) * AT_EACH);
            if (from < end) {
                const at_sums kept = at_kept_at(at_tail_at(s, m, from));
                tail.n = kept.n;
                tail.t = kept.t;
                tail.tt = kept.tt;
                for (row = 0; row < (AT_SUMS * (int64_t)s->channels); row++) {
                    tail.of[row] = kept.of[row];
                }
            }
            for (row = from - 1; row >= head; row--) {
                at_add_row(s, m, &tail, row, last, gaps);
            }
            rest = at_kept_at(&at_whole_at(s, m, starts[block])[at_kept_width(s)]);
            at_finish(p, s, m, s->order[nth], &tail, &rest, &now, (at_real)at_minus(last, origin));
        }
    }
}

static void at_run_slope(const at_plan *p, const at_slope *s, at_memory m)
{
    at_sums now = { AT_R(0.0), AT_R(0.0), AT_R(0.0), NULL };
    at_sums rest = now;
    at_sums tail = now;
    at_sums none = now;
    const int32_t width = AT_SUMS * s->channels;
    int64_t block;
    int64_t current;
    int64_t rows;
    int64_t origin;
    int64_t row;
    int gaps;
    int anew;
    int32_t nth = 0;
    if (at_gather_is(p, m, s->gather, AT_FRESH) == 0) {
        return;
    }
    anew = at_push(p, s, m);
    if (AT_IS_USED(AT_FAST) && (s->kept >= 0)) {
        at_run_fast(p, s, m, anew);
        return;
    }
    now.of = &m.r[p->scratch];
    rest.of = &m.r[p->scratch + width];
    tail.of = &m.r[p->scratch + (2 * width)];
    none.of = &m.r[p->scratch + (3 * width)];
    at_clear(&now, s->channels);
    at_clear(&rest, s->channels);
    at_clear(&none, s->channels);
    rows = m.i[s->ints + AT_ROWS];
    block = m.i[s->ints + AT_BLOCKS] - 1;
    current = m.i[s->ints + AT_STARTS + block];
    origin = at_row_time(s, m, current);
    gaps = (m.i[at_heads(s) + s->order[s->windows - 1]] < m.i[s->ints + AT_COMPLETE_FROM]) ? 1 : 0;
    for (row = current; row < rows; row++) {
        at_add_row(s, m, &now, row, origin, gaps);
    }
    /* Windows that begin within the current block. */
    while ((nth < s->windows) && (m.i[at_heads(s) + s->order[nth]] >= current)) {
        const int64_t first = m.i[at_heads(s) + s->order[nth]];
        if (first > current) {
            at_clear(&tail, s->channels);
            for (row = first; row < rows; row++) {
                at_add_row(s, m, &tail, row, at_row_time(s, m, first), gaps);
            }
            at_finish(p, s, m, s->order[nth], &none, &none, &tail, AT_R(0.0));
        } else {
            at_finish(p, s, m, s->order[nth], &none, &none, &now, AT_R(0.0));
        }
        nth++;
    }
    /* The others, block by block into the past. */
    while ((nth < s->windows) && (block > 0)) {
        int64_t end = m.i[s->ints + AT_STARTS + block];
        int64_t last = at_row_time(s, m, end - 1);
        const at_real by = (at_real)at_minus(last, origin);
        const int64_t first = m.i[s->ints + AT_STARTS + block - 1];
        at_clear(&tail, s->channels);
        for (row = end - 1; (row >= first) && (nth < s->windows); row--) {
            at_add_row(s, m, &tail, row, last, gaps);
            while ((nth < s->windows) && (m.i[at_heads(s) + s->order[nth]] == row)) {
                at_finish(p, s, m, s->order[nth], &tail, &rest, &now, by);
                nth++;
            }
        }
        at_add_shifted(s, &rest, &tail, by, gaps);
        block--;
    }
}

static void at_begin_slope(const at_slope *s, at_memory m)
{
    int32_t nth;
    for (nth = s->ints; nth < (at_channels(s) + s->channels); nth++) {
        m.i[nth] = 0;
    }
    m.i[s->ints + AT_BLOCKS] = 1;
    for (nth = 0; nth < s->channels; nth++) {
        m.r[s->reals + nth] = AT_R(0.0);
    }
}

/* ---- Lags. */

static void at_run_lag(const at_plan *p, const at_lag *l, at_memory m)
{
    const int64_t now = m.i[AT_LAST];
    int32_t channel;
    for (channel = 0; channel < l->channels; channel++) {
        const at_entry *e = at_entry_of(p, l->gather, channel);
        const at_history *h = &p->history[l->first_history + channel];
        int64_t stamp;
        at_real value;
        int32_t nth;
        if (at_ran(p, m, e->slot) == 0) {
            continue;
        }
        value = at_unless_infinite(at_read(p, m, e, 0, &stamp));
        at_write(h, m, now, value, stamp);
        if (at_is_absent(value) != 0) {
            continue;
        }
        for (nth = 0; nth < l->lags; nth++) {
            int64_t of;
            const at_real past = at_past(h, m, at_minus(now, l->lag[nth]), l->max_age[channel], &of);
            at_give(p, m, l->slot + (channel * l->lags) + nth, past, at_plus(of, l->lag[nth]));
        }
    }
}

/* ---- First-order lags. Of integers: whether each channel has begun, and when its last sample was; of numbers: that, and values. */

static void at_run_first_order(const at_plan *p, const at_first_order *f, at_memory m)
{
    const int64_t now = m.i[AT_LAST];
    int32_t channel;
    if (at_gather_is(p, m, f->gather, AT_FRESH) == 0) {
        return;
    }
    for (channel = 0; channel < f->channels; channel++) {
        int64_t stamp;
        const at_real input = at_port(p, m, f->gather, channel, &stamp);
        const at_real before = m.r[f->reals + channel];
        int32_t nth;
        if (at_is_absent(input) != 0) {
            continue;
        }
        for (nth = 0; nth < f->bank; nth++) {
            at_real *value = &m.r[f->reals + f->channels + (channel * f->bank) + nth];
            if (m.i[f->ints + channel] == 0) {
                *value = input;
            } else {
                const at_real elapsed = at_seconds(at_minus(now, m.i[f->ints + f->channels + channel]));
                const at_real moved = (at_real)at_expm1((double)(-elapsed * f->rates[nth]));
                *value = *value - (moved * (before - *value));
                if (!isfinite(*value)) {
                    *value = input;
                }
            }
            at_give(p, m, f->slot + (channel * f->bank) + nth, (f->difference != 0) ? (input - *value) : *value, now);
        }
        m.i[f->ints + channel] = 1;
        m.i[f->ints + f->channels + channel] = now;
        m.r[f->reals + channel] = input;
    }
}

/* ---- Linear estimators. */

/* A constant and a product, which is summed in four strands. */
static at_real at_form(at_real constant, const at_real b[], const at_real row[], int32_t width)
{
    at_real sums[4] = { AT_R(0.0), AT_R(0.0), AT_R(0.0), AT_R(0.0) };
    at_real others = AT_R(-0.0);
    int32_t nth = 0;
    while ((nth + 4) <= width) {
        sums[0] = sums[0] + (b[nth] * row[nth]);
        sums[1] = sums[1] + (b[nth + 1] * row[nth + 1]);
        sums[2] = sums[2] + (b[nth + 2] * row[nth + 2]);
        sums[3] = sums[3] + (b[nth + 3] * row[nth + 3]);
        nth += 4;
    }
    while (nth < width) {
        others = others + (b[nth] * row[nth]);
        nth++;
    }
    return constant + (((sums[0] + sums[2]) + (sums[1] + sums[3])) + others);
}

static at_real at_novelty_of(const at_novelty *n, const at_real row[], int32_t width, at_real along[])
{
    at_real size = AT_R(0.0);
    at_real known = AT_R(0.0);
    at_real beyond;
    int32_t column;
    int32_t nth;
    for (nth = 0; nth < n->directions; nth++) {
        along[nth] = AT_R(0.0);
    }
    for (column = 0; column < width; column++) {
        const at_real z = (row[column] - n->mean[column]) * n->inverse[column];
        size = size + (z * z);
        for (nth = 0; nth < n->directions; nth++) {
            along[nth] = along[nth] + (n->along[(column * n->directions) + nth] * z);
        }
    }
    for (nth = 0; nth < n->directions; nth++) {
        known = known + (along[nth] * along[nth]);
    }
    beyond = size - known;
    if (!(beyond > AT_R(0.0))) {
        beyond = AT_R(0.0);
    }
    return at_unless_infinite(at_root(at_over(beyond, (size + (at_real)width) * n->edge)));
}

/* Room within a step: the row, the same standardised, with 1 behind it, then what else is needed. */
static at_real *at_standardised(const at_plan *p, const at_linear *l, at_memory m)
{
    return &m.r[p->scratch + l->width];
}

static void at_standardise(const at_plan *p, const at_linear *l, at_memory m, const at_real row[])
{
    at_real *z = at_standardised(p, l, m);
    int32_t nth;
    for (nth = 0; nth < l->width; nth++) {
        z[nth] = (row[nth] - l->spread->mean[nth]) / l->spread->scale[nth];
    }
    z[l->width] = AT_R(1.0);
}

/* The variance that coefficients bring into a prediction, in that of the noise: of the row that was standardised last. */
static at_real at_spread_of(const at_plan *p, const at_linear *l, at_memory m, const at_real root[])
{
    const at_real *z = at_standardised(p, l, m);
    const at_real *row = root;
    at_real sum = AT_R(-0.0);
    int32_t i;
    int32_t j;
    for (i = 0; i <= l->width; i++) {
        at_real along = AT_R(-0.0);
        for (j = 0; j <= i; j++) {
            along = along + (row[j] * z[j]);
        }
        sum = sum + (along * along);
        row = &row[i + 1];
    }
    return sum;
}

/* ---- Learners. Of integers: where the oldest waiting truth lies and how many wait; why nothing is learned from this tick; of recent errors
 * how many there were, how many in a row were too large and since when, and whether they are in units of a deviation; when the last truth
 * taught, and up to when what was learned has faded; when the newest window of truth began and the last truth came, how many windows there
 * were and which is the newest; of waiting truths the arrival, the run and why it is not learned from. Of numbers: the mean square of recent
 * errors; what was learned, information, where it goes back to, pull, as how many rows it counts and the squares of their errors; what
 * follows from it, the root of the covariance, coefficients of standardised regressors, and coefficients and constant as they are used; of each window the squares of the
 * errors of the learner and of its fit; waiting truths.
 *
 * Of past rows, which several share, integers: how many there were, the number of the first that counts, the tick of the last; times, and why
 * each is not learned from. */

#define AT_L_WAITING_FROM 0
#define AT_L_WAITING 1
#define AT_L_FROZEN 2
#define AT_L_SEEN 3
#define AT_L_REFUSED 4
#define AT_L_WEIGHED 5
#define AT_L_SINCE 6
#define AT_L_LESSON 7
#define AT_L_FADED 8
#define AT_L_FROM 9
#define AT_L_TRUTH 10
#define AT_L_WINDOWS 11
#define AT_L_NEWEST 12
#define AT_L_ARRIVED 13
/* No instant. */
#define AT_NEVER INT64_MIN

#define AT_P_RUNS 0
#define AT_P_FIRST 1
#define AT_P_TICK 2
#define AT_P_TIMES 3

#define AT_LEARNED 0
/* 1: on command, which a run knows. */
#define AT_OF_CHANNEL 2
#define AT_OUTLIER 3
#define AT_OUT_OF_RANGE 4
#define AT_OUT_OF_LIMITS 5
#define AT_INCOMPLETE 6
#define AT_PASSED_OVER 7

/* Who speaks: the learner, or the fit since there were too few windows of truth, since it errs less, or since no truth came. */
#define AT_LEARNER 0
#define AT_TOO_FEW 10
#define AT_WORSE 20
#define AT_SILENCE 30

/* How many errors weigh in, how many there must have been before one is too large, and how many in a row can be, in so many windows; as how
 * large, squared, one that is too large counts. */
#define AT_ERRORS 50
#define AT_FIRST_ERRORS 10
#define AT_PATIENCE 20
#define AT_PATIENT_WINDOWS 4
#define AT_OF_REFUSED AT_R(4.0)
/* By so many deviations a truth misses that moves the constant alone; and as by so many counts one that misses by more. */
#define AT_LEAP AT_R(100.0)
#define AT_MOST_MISSED AT_R(2.0)
/* Over how many windows the learner is compared with its fit. */
#define AT_WINDOWS 20

typedef struct {
    int64_t *known;
    int64_t *arrived;
    int64_t *run_of;
    int64_t *notes;
    int64_t *runs;
    at_real *rows;
    at_real *mean_square;
    at_real *information;
    at_real *start;
    at_real *pull;
    at_real *counts;
    at_real *root;
    at_real *theta;
    at_real *b;
    at_real *constant;
    at_real *windows;
    at_real *truths;
    int32_t order;
    int32_t cells;
} at_pupil;

static at_pupil at_pupil_of(const at_linear *l, at_memory m)
{
    const at_learner *g = l->learner;
    at_pupil u;
    u.order = l->width + 1;
    u.cells = (u.order * (u.order + 1)) / 2;
    u.known = &m.i[g->ints];
    u.arrived = &u.known[AT_L_ARRIVED];
    u.run_of = &u.arrived[g->waiting];
    u.notes = &u.run_of[g->waiting];
    u.runs = &m.i[g->run_ints];
    u.rows = &m.r[g->run_reals];
    u.mean_square = &m.r[g->reals];
    u.information = &u.mean_square[1];
    u.start = &u.information[u.cells];
    u.pull = &u.start[u.order];
    u.counts = &u.pull[u.order];
    u.root = &u.counts[2];
    u.theta = &u.root[u.cells];
    u.b = &u.theta[u.order];
    u.constant = &u.b[l->width];
    u.windows = &u.constant[1];
    u.truths = &u.windows[2 * AT_WINDOWS];
    return u;
}

/* The last of several runs at or before an instant, unless it lies too long before: its number, or -1. */
static int64_t at_run_at(at_memory m, const int64_t times[], int32_t room, int64_t first, int64_t runs, int64_t due,
                         int64_t limit)
{
    const int64_t oldest = ((runs - first) > (int64_t)room) ? (runs - (int64_t)room) : first;
    int64_t low = oldest;
    int64_t high = runs;
    int64_t found = -1;
    while (low < high) {
        const int64_t middle = low + ((high - low) / 2);
        if (times[middle % (int64_t)room] <= due) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    if (low > oldest) {
        if (at_minus(due, times[(low - 1) % (int64_t)room]) <= limit) {
            found = low - 1;
        }
    } else if (oldest > first) {
        m.i[AT_FLAGS] |= (int64_t)AT_FULL;
    } else {
        /* There was none yet. */
    }
    return found;
}

/* Where a truth is put that has just been measured, of a ring in which it waits: the oldest goes where there is no room. */
static int32_t at_wait(at_memory m, int64_t waiting[], int32_t room)
{
    if (waiting[1] >= (int64_t)room) {
        waiting[0] = (waiting[0] + 1) % (int64_t)room;
        waiting[1]--;
        m.i[AT_FLAGS] |= (int64_t)AT_FULL;
    }
    waiting[1]++;
    return (int32_t)((waiting[0] + (waiting[1] - 1)) % (int64_t)room);
}

/* Coefficients as they are used. */
static void at_use(const at_linear *l, const at_pupil *u)
{
    int32_t nth;
    for (nth = 0; nth < l->width; nth++) {
        u->b[nth] = u->theta[nth] / l->spread->scale[nth];
    }
    *u->constant = (u->theta[l->width] + l->learner->level) - at_form(AT_R(0.0), u->b, l->spread->mean, l->width);
}

/* Whether an error is no outlier among recent ones, which it joins. */
static int at_admits(const at_learner *g, const at_pupil *u, at_real missed, at_real std_dev, int64_t at)
{
    const int64_t weighed = ((std_dev > AT_R(0.0)) && isfinite(std_dev)) ? 1 : 0;
    const at_real error = (weighed != 0) ? (missed / std_dev) : missed;
    const at_real square = error * error;
    const int64_t patience =
        (g->window > (INT64_MAX / AT_PATIENT_WINDOWS)) ? INT64_MAX : (g->window * AT_PATIENT_WINDOWS);
    const int64_t since = u->known[AT_L_SINCE];
    const int waited = ((since == AT_NEVER) || (at < since) || (at_minus(at, since) >= patience)) ? 1 : 0;
    at_real most = (at_real)INFINITY;
    at_real counted;
    int admitted = 0;
    if (isfinite(square)) {
        if (((u->known[AT_L_REFUSED] >= AT_PATIENCE) && (waited != 0)) || (weighed != u->known[AT_L_WEIGHED])) {
            const int of_fit = ((weighed != 0) && (u->known[AT_L_WEIGHED] == 0)) ? 1 : 0;
            u->known[AT_L_SEEN] = (of_fit != 0) ? AT_FIRST_ERRORS : 0;
            *u->mean_square = (of_fit != 0) ? AT_R(1.0) : AT_R(0.0);
            u->known[AT_L_REFUSED] = 0;
            u->known[AT_L_SINCE] = AT_NEVER;
            u->known[AT_L_WEIGHED] = weighed;
        }
        if ((u->known[AT_L_SEEN] >= AT_FIRST_ERRORS) && (*u->mean_square > AT_R(0.0)) && isfinite(g->outliers)) {
            most = (g->outliers * g->outliers) * *u->mean_square;
        }
        admitted = (square <= most) ? 1 : 0;
        counted = AT_OF_REFUSED * *u->mean_square;
        if ((admitted != 0) || (square < counted)) {
            counted = square;
        }
        if (u->known[AT_L_SEEN] < AT_ERRORS) {
            u->known[AT_L_SEEN]++;
        }
        *u->mean_square = *u->mean_square + ((counted - *u->mean_square) / (at_real)u->known[AT_L_SEEN]);
        if (admitted != 0) {
            u->known[AT_L_REFUSED] = 0;
            u->known[AT_L_SINCE] = AT_NEVER;
        } else {
            u->known[AT_L_REFUSED]++;
            if (u->known[AT_L_SINCE] == AT_NEVER) {
                u->known[AT_L_SINCE] = at;
            }
        }
    }
    return admitted;
}

/* Where a row of a triangle begins. */
static int32_t at_row_of(int32_t row)
{
    return (row * (row + 1)) / 2;
}

/* Puts the inverse of Cholesky's factor in the place of a matrix; 0 where that is not positive. */
static int at_invert_root(at_real root[], at_real room[], int32_t order)
{
    int positive = 1;
    int32_t i;
    int32_t j;
    int32_t k;
    for (k = 0; (k < order) && (positive != 0); k++) {
        const at_real square = root[at_row_of(k) + k];
        const at_real pivot = (square > AT_R(0.0)) ? at_root(square) : AT_R(0.0);
        if (!((pivot > AT_R(0.0)) && isfinite(pivot))) {
            positive = 0;
        } else {
            root[at_row_of(k) + k] = pivot;
            for (i = k + 1; i < order; i++) {
                root[at_row_of(i) + k] = at_over(root[at_row_of(i) + k], pivot);
                room[i] = root[at_row_of(i) + k];
            }
            for (i = k + 1; i < order; i++) {
                at_real *row = &root[at_row_of(i)];
                for (j = k + 1; j <= i; j++) {
                    row[j] = row[j] - (room[i] * room[j]);
                }
            }
        }
    }
    for (i = 0; (i < order) && (positive != 0); i++) {
        at_real *row = &root[at_row_of(i)];
        const at_real pivot = row[i];
        for (j = 0; j < i; j++) {
            room[j] = row[j];
            row[j] = AT_R(0.0);
        }
        for (k = 0; k < i; k++) {
            const at_real *done = &root[at_row_of(k)];
            for (j = 0; j <= k; j++) {
                row[j] = row[j] - (room[k] * done[j]);
            }
        }
        row[i] = AT_R(1.0);
        for (j = 0; j <= i; j++) {
            row[j] = at_over(row[j], pivot);
        }
    }
    return positive;
}

/* Begins with what the fit knew. */
static void at_begin_again(const at_linear *l, const at_pupil *u)
{
    const at_learner *g = l->learner;
    int32_t nth;
    for (nth = 0; nth < u->cells; nth++) {
        u->information[nth] = g->information[nth];
        u->root[nth] = l->spread->root[nth];
    }
    for (nth = 0; nth < u->order; nth++) {
        u->start[nth] = g->start[nth];
        u->pull[nth] = AT_R(0.0);
        u->theta[nth] = g->start[nth];
    }
    u->counts[0] = g->rows;
    u->counts[1] = g->squares;
}

/* Finds root and coefficients from what was learned; what cannot be solved any more begins again. */
static void at_solve(const at_plan *p, const at_linear *l, at_memory m, const at_pupil *u)
{
    at_real *room = &at_standardised(p, l, m)[u->order];
    int solved;
    int32_t i;
    int32_t j;
    for (i = 0; i < u->cells; i++) {
        u->root[i] = u->information[i];
    }
    solved = at_invert_root(u->root, room, u->order);
    if (solved != 0) {
        for (i = 0; i < u->order; i++) {
            u->theta[i] = u->start[i];
        }
        for (i = 0; i < u->order; i++) {
            const at_real *row = &u->root[at_row_of(i)];
            const at_real along = at_form(AT_R(-0.0), row, u->pull, i + 1);
            for (j = 0; j <= i; j++) {
                u->theta[j] = u->theta[j] + (along * row[j]);
            }
        }
        for (i = 0; i < u->order; i++) {
            if (!isfinite(u->theta[i])) {
                solved = 0;
            }
        }
    }
    if (solved == 0) {
        at_begin_again(l, u);
    }
}

/* A step of recursive least squares whose past fades to a share of the fit, with the row that was standardised last. */
static void at_recur(const at_plan *p, const at_linear *l, at_memory m, const at_pupil *u, at_real truth, at_real after)
{
    const at_learner *g = l->learner;
    const at_real *x = at_standardised(p, l, m);
    const at_real error = truth - at_form(AT_R(-0.0), u->theta, x, u->order);
    const at_real of_start = truth - at_form(AT_R(-0.0), u->start, x, u->order);
    const at_real square = at_over(error * error, AT_R(1.0) + at_spread_of(p, l, m, u->root));
    int32_t i;
    int32_t j;
    if (isfinite(square) && isfinite(of_start)) {
        const at_real left = (at_real)at_exp((double)at_over(-after, g->memory));
        const at_real back = (AT_R(1.0) - left) * g->share;
        for (i = 0; i < u->order; i++) {
            at_real *row = &u->information[at_row_of(i)];
            const at_real *start = &g->information[at_row_of(i)];
            for (j = 0; j <= i; j++) {
                row[j] = ((left * row[j]) + (back * start[j])) + (x[i] * x[j]);
            }
            u->pull[i] = (left * u->pull[i]) + (x[i] * of_start);
        }
        u->counts[0] = ((left * u->counts[0]) + (back * g->rows)) + AT_R(1.0);
        u->counts[1] = ((left * u->counts[1]) + (back * g->squares)) + square;
        at_solve(p, l, m, u);
    }
}

/* Moves the constant, and where it goes back to, which is then known as by one row alone. */
static void at_leap(const at_plan *p, const at_linear *l, at_memory m, const at_pupil *u, at_real by)
{
    at_real *row = &at_standardised(p, l, m)[u->order];
    const int32_t last = u->order - 1;
    at_real known;
    int32_t i;
    int32_t j;
    u->theta[last] = u->theta[last] + by;
    u->start[last] = u->start[last] + by;
    for (j = 0; j <= last; j++) {
        row[j] = u->information[at_row_of(last) + j];
    }
    known = row[last];
    if (known > AT_R(1.0)) {
        const at_real less = (AT_R(1.0) - (AT_R(1.0) / known)) / known;
        for (i = 0; i < last; i++) {
            for (j = 0; j <= i; j++) {
                at_real *cell = &u->information[at_row_of(i) + j];
                *cell = *cell - ((row[i] * row[j]) * less);
            }
            u->information[at_row_of(last) + i] = row[i] / known;
        }
        u->information[at_row_of(last) + last] = AT_R(1.0);
    }
    for (i = 0; i <= last; i++) {
        at_real sum = AT_R(-0.0);
        for (j = 0; j <= last; j++) {
            const int32_t place = (j < i) ? (at_row_of(i) + j) : (at_row_of(j) + i);
            sum = sum + (u->information[place] * (u->theta[j] - u->start[j]));
        }
        u->pull[i] = sum;
    }
    at_solve(p, l, m, u);
}

/* The errors of a learner and of its fit for a truth that tells of a window. */
static void at_weigh_against_fit(const at_learner *g, const at_pupil *u, at_real missed, at_real of_fit, int64_t at)
{
    const int64_t from = u->known[AT_L_FROM];
    at_real *sums;
    u->known[AT_L_TRUTH] = at;
    if ((from == AT_NEVER) || (at < from) || (at_minus(at, from) >= g->window)) {
        u->known[AT_L_FROM] = at;
        if (u->known[AT_L_WINDOWS] < AT_WINDOWS) {
            u->known[AT_L_NEWEST] = u->known[AT_L_WINDOWS];
            u->known[AT_L_WINDOWS]++;
        } else {
            u->known[AT_L_NEWEST] = (u->known[AT_L_NEWEST] + 1) % AT_WINDOWS;
        }
        u->windows[2 * u->known[AT_L_NEWEST]] = AT_R(0.0);
        u->windows[(2 * u->known[AT_L_NEWEST]) + 1] = AT_R(0.0);
    }
    sums = &u->windows[2 * u->known[AT_L_NEWEST]];
    sums[0] = sums[0] + (missed * missed);
    sums[1] = sums[1] + (of_fit * of_fit);
}

/* Who speaks at an instant. */
static int32_t at_speaks(const at_learner *g, const at_pupil *u, int64_t now)
{
    int32_t speaks = AT_TOO_FEW;
    if (u->known[AT_L_WINDOWS] >= AT_WINDOWS) {
        if (at_minus(now, u->known[AT_L_TRUTH]) > g->silence) {
            speaks = AT_SILENCE;
        } else {
            at_real of_learner = AT_R(-0.0);
            at_real of_fit = AT_R(-0.0);
            int32_t nth;
            for (nth = 0; nth < AT_WINDOWS; nth++) {
                of_learner = of_learner + u->windows[2 * nth];
                of_fit = of_fit + u->windows[(2 * nth) + 1];
            }
            speaks = (of_learner <= of_fit) ? AT_LEARNER : AT_WORSE;
        }
    }
    return speaks;
}

/* Lets a row and its truth be learned from, unless something speaks against it. */
static int32_t at_offer(const at_plan *p, const at_linear *l, at_memory m, const at_pupil *u, const at_real row[],
                        at_real truth, int64_t at)
{
    const at_learner *g = l->learner;
    const at_real size = at_size(truth);
    const int64_t lesson = u->known[AT_L_LESSON];
    int32_t became = AT_LEARNED;
    int32_t nth;
    for (nth = 0; nth < l->width; nth++) {
        if (at_is_absent(row[nth]) != 0) {
            became = AT_INCOMPLETE;
        } else if ((became == AT_LEARNED) && !((row[nth] >= g->lowest[nth]) && (row[nth] <= g->highest[nth]))) {
            became = AT_OUT_OF_RANGE;
        } else {
            /* As the others are. */
        }
    }
    if ((became != AT_INCOMPLETE) && !((size < g->below) && (size >= g->above))) {
        became = AT_OUT_OF_LIMITS;
    }
    if ((became == AT_LEARNED) || (became == AT_OUT_OF_RANGE)) {
        if ((lesson != AT_NEVER) && (at >= lesson) && (at_minus(at, lesson) < g->between)) {
            became = AT_PASSED_OVER;
        } else {
            u->known[AT_L_LESSON] = at;
        }
    }
    if (became == AT_LEARNED) {
        const at_real missed = truth - at_form(*u->constant, u->b, row, l->width);
        const at_real of_fit = truth - at_form(l->constant, l->coefficients, row, l->width);
        at_real std_dev;
        at_standardise(p, l, m, row);
        std_dev = at_root(at_over(u->counts[1], u->counts[0]) * (AT_R(1.0) + at_spread_of(p, l, m, u->root)));
        if (at_admits(g, u, missed, std_dev, at) == 0) {
            became = AT_OUTLIER;
        } else {
            if (at_spread_of(p, l, m, l->spread->root) < g->little) {
                became = AT_PASSED_OVER;
                u->known[AT_L_FADED] = at;
            } else {
                const int64_t faded = u->known[AT_L_FADED];
                const at_real after = ((faded == AT_NEVER) || (at < faded)) ? AT_R(0.0) : at_seconds(at_minus(at, faded));
                u->known[AT_L_FADED] = at;
                if ((g->window == 0) && isfinite(missed) && (at_size(missed) > (AT_LEAP * std_dev)) && (std_dev > AT_R(0.0))) {
                    at_leap(p, l, m, u, missed);
                } else {
                    const at_real most_of_it = AT_MOST_MISSED * std_dev;
                    at_real lesson_of = truth - g->level;
                    if (at_size(missed) > most_of_it) {
                        lesson_of = (lesson_of - missed) + at_signed(most_of_it, missed);
                    }
                    at_recur(p, l, m, u, lesson_of, after);
                }
                at_use(l, u);
            }
            at_weigh_against_fit(g, u, missed, of_fit, at);
        }
    }
    return became;
}

/* Learns from every truth that arrived up to `newest`: what became of the last one and when it had arrived; -1 where there was none. */
static int32_t at_learn(const at_plan *p, const at_linear *l, at_memory m, int64_t newest, int64_t *arrived)
{
    const at_learner *g = l->learner;
    const at_pupil u = at_pupil_of(l, m);
    int32_t became = -1;
    while ((u.known[AT_L_WAITING] > 0) && (u.arrived[u.known[AT_L_WAITING_FROM]] <= newest)) {
        const int64_t place = u.known[AT_L_WAITING_FROM];
        const int64_t run = u.run_of[place];
        const int64_t at = run % (int64_t)g->runs;
        int64_t frozen = u.known[AT_L_FROZEN];
        u.known[AT_L_WAITING_FROM] = (place + 1) % (int64_t)g->waiting;
        u.known[AT_L_WAITING]--;
        if ((u.runs[AT_P_RUNS] - run) > (int64_t)g->runs) {
            m.i[AT_FLAGS] |= (int64_t)AT_FULL;
        } else {
            const int64_t of_run = u.runs[AT_P_TIMES + g->runs + at];
            frozen = (of_run > frozen) ? of_run : frozen;
            frozen = (u.notes[place] > frozen) ? u.notes[place] : frozen;
            *arrived = u.arrived[place];
            became = (frozen > 0) ? (int32_t)frozen
                                  : at_offer(p, l, m, &u, &u.rows[at * (int64_t)l->width], u.truths[place], *arrived);
        }
    }
    return became;
}

/* Learns before it predicts: who speaks. */
static int32_t at_learn_now(const at_plan *p, const at_linear *l, at_memory m)
{
    const at_learner *g = l->learner;
    const at_pupil u = at_pupil_of(l, m);
    int64_t arrived = 0;
    int32_t speaks;
    int32_t became;
    int32_t nth;
    m.i[g->ints + AT_L_FROZEN] = AT_LEARNED;
    if (g->freeze >= 0) {
        for (nth = 0; nth < p->gather[g->freeze].count; nth++) {
            int64_t stamp;
            /* Without a clear 0 it does not go on. */
            if (!(at_port(p, m, g->freeze, nth, &stamp) == AT_R(0.0))) {
                m.i[g->ints + AT_L_FROZEN] = AT_OF_CHANNEL;
            }
        }
    }
    became = at_learn(p, l, m, at_minus(m.i[AT_LAST], g->embargo), &arrived);
    speaks = at_speaks(g, &u, m.i[AT_LAST]);
    if (became >= 0) {
        at_put(p, m, l->slot + 1, (at_real)(became + speaks), arrived);
    } else {
        const at_real said = at_value(p, m, l->slot + 1);
        if (said >= AT_R(0.0)) {
            const int32_t before = (int32_t)said;
            if (((before / 10) * 10) != speaks) {
                at_put(p, m, l->slot + 1, (at_real)((before % 10) + speaks), m.i[AT_LAST]);
            }
        }
    }
    return speaks;
}

/* Writes a row down, whole or none of it, unless another learner has. */
static void at_write_row(const at_linear *l, at_memory m, const at_real row[], int whole)
{
    const at_learner *g = l->learner;
    const at_pupil u = at_pupil_of(l, m);
    int32_t nth;
    if (u.runs[AT_P_TICK] != m.i[AT_TICK]) {
        const int64_t at = u.runs[AT_P_RUNS] % (int64_t)g->runs;
        u.runs[AT_P_TICK] = m.i[AT_TICK];
        u.runs[AT_P_TIMES + at] = m.i[AT_LAST];
        u.runs[AT_P_TIMES + g->runs + at] = u.known[AT_L_FROZEN];
        for (nth = 0; nth < l->width; nth++) {
            u.rows[(at * (int64_t)l->width) + nth] = (whole != 0) ? row[nth] : AT_NAN;
        }
        u.runs[AT_P_RUNS]++;
    }
}

/* Takes a truth that has just been measured, now that all outputs are there. */
static void at_note_truth(const at_plan *p, const at_linear *l, at_memory m)
{
    const at_learner *g = l->learner;
    const at_pupil u = at_pupil_of(l, m);
    const int64_t run = at_run_at(m, &u.runs[AT_P_TIMES], g->runs, u.runs[AT_P_FIRST], u.runs[AT_P_RUNS],
                                  at_minus(m.i[AT_LAST], g->ahead), g->limit);
    if (run >= 0) {
        const int32_t place = at_wait(m, &u.known[AT_L_WAITING_FROM], g->waiting);
        u.arrived[place] = m.i[AT_LAST];
        u.run_of[place] = run;
        u.notes[place] = u.known[AT_L_FROZEN];
        u.truths[place] = at_value(p, m, g->truth);
    }
}

/* Begins as it was fitted, or with another segment, in which what was learned stays. */
static void at_begin_learner(const at_plan *p, const at_linear *l, at_memory m, int segment)
{
    const at_pupil u = at_pupil_of(l, m);
    int64_t arrived = 0;
    int32_t nth;
    if (segment != 0) {
        (void)at_learn(p, l, m, m.i[AT_LAST], &arrived);
        u.runs[AT_P_FIRST] = u.runs[AT_P_RUNS];
        return;
    }
    at_begin_again(l, &u);
    for (nth = AT_L_SINCE; nth <= AT_L_TRUTH; nth++) {
        u.known[nth] = AT_NEVER;
    }
    at_use(l, &u);
}

/* The clock of another segment. */
static void at_shift_learner(const at_linear *l, at_memory m, int64_t shift)
{
    int32_t nth;
    for (nth = AT_L_SINCE; nth <= AT_L_TRUTH; nth++) {
        int64_t *instant = &m.i[l->learner->ints + nth];
        if (*instant != AT_NEVER) {
            *instant = at_plus(*instant, shift);
        }
    }
}

/* The standard deviation of the truth about a prediction, of a row of which the standardised one is there where it is needed. */
static at_real at_std_dev_of(const at_plan *p, const at_linear *l, at_memory m, const at_real row[],
                             const at_real known[], at_real variance)
{
    at_real std_dev = AT_NAN;
    int32_t i;
    int32_t j;
    if (l->spread != NULL) {
        std_dev = at_root(variance * (AT_R(1.0) + at_spread_of(p, l, m, known)));
    } else if (l->variance != NULL) {
        const at_real *root = l->variance->root;
        at_real leverage = l->variance->least;
        for (i = 0; i < l->width; i++) {
            at_real along = AT_R(-0.0);
            for (j = 0; j <= i; j++) {
                along = along + (root[j] * (row[j] - l->variance->centre[j]));
            }
            leverage = leverage + (along * along);
            root = &root[i + 1];
        }
        std_dev = at_root(l->variance->noise * (AT_R(1.0) + leverage));
    } else {
        /* Nobody knows it. */
    }
    return std_dev;
}

static void at_run_linear(const at_plan *p, const at_linear *l, at_memory m)
{
    const int64_t now = m.i[AT_LAST];
    at_real *row = &m.r[p->scratch];
    const at_real *b = l->coefficients;
    const at_real *known = NULL;
    at_real variance = AT_R(0.0);
    at_real constant = l->constant;
    at_real centre = l->centre;
    at_real value = AT_NAN;
    at_real novelty = AT_NAN;
    at_real std_dev = AT_NAN;
    int64_t oldest = (l->width == 0) ? now : INT64_MAX;
    int whole = 1;
    int32_t speaks = AT_TOO_FEW;
    int32_t nth;
    if (AT_IS_USED(AT_LEARNS) && (l->learner != NULL)) {
        speaks = at_learn_now(p, l, m);
    }
    if ((l->trigger >= 0) && (at_gather_is(p, m, l->trigger, AT_FRESH) == 0)) {
        return;
    }
    for (nth = 0; nth < l->width; nth++) {
        int64_t stamp;
        row[nth] = at_read(p, m, &l->entries[nth], 1, &stamp);
        if (at_is_absent(row[nth]) != 0) {
            whole = 0;
        } else if (stamp < oldest) {
            oldest = stamp;
        } else {
            /* Another is older. */
        }
    }
    if (oldest == INT64_MAX) {
        whole = 0;
    }
    if (AT_IS_USED(AT_STD_DEVS) && (l->spread != NULL)) {
        known = l->spread->root;
        variance = l->spread->variance;
    }
    if (AT_IS_USED(AT_LEARNS) && (l->learner != NULL)) {
        const at_pupil u = at_pupil_of(l, m);
        at_write_row(l, m, row, whole);
        known = l->spread->root;
        variance = l->spread->variance;
        if (speaks == AT_LEARNER) {
            b = u.b;
            constant = *u.constant;
            centre = u.theta[l->width] + l->learner->level;
            known = u.root;
            variance = at_over(u.counts[1], u.counts[0]);
        }
    }
    if (whole != 0) {
        value = (l->same != 0) ? row[0] : at_form(constant, b, row, l->width);
        if ((known != NULL) && ((l->novelty != NULL) || (l->std_dev_slot >= 0))) {
            at_standardise(p, l, m, row);
        }
        if (l->novelty != NULL) {
            novelty = at_novelty_of(l->novelty, row, l->width, &row[(2 * l->width) + 1]);
            if (AT_IS_USED(AT_LEARNS) && (speaks == AT_LEARNER) && (novelty > AT_R(1.0))) {
                const at_real share =
                    at_root(at_over(at_spread_of(p, l, m, known), at_spread_of(p, l, m, l->spread->root)));
                if (isfinite(share)) {
                    novelty = AT_R(1.0) + ((novelty - AT_R(1.0)) * share);
                }
            }
            if (novelty > AT_R(1.0)) {
                if (l->outside == AT_SHRINK) {
                    value = centre + ((value - centre) / novelty);
                } else if (l->outside == AT_GONE) {
                    value = AT_NAN;
                } else {
                    /* It passes. */
                }
            }
        }
        if (AT_IS_USED(AT_STD_DEVS) && (l->std_dev_slot >= 0) && (at_is_absent(value) == 0)) {
            std_dev = at_std_dev_of(p, l, m, row, known, variance);
            if ((novelty > AT_R(1.0)) && (l->outside == AT_SHRINK)) {
                const at_real moved = (value - centre) * (novelty - AT_R(1.0));
                const at_real wide = novelty * std_dev;
                std_dev = at_root((wide * wide) + (moved * moved));
            }
        }
    }
    if (!isfinite(value)) {
        value = AT_NAN;
        std_dev = AT_NAN;
        oldest = now;
    }
    at_put(p, m, l->slot, value, oldest);
    if (AT_IS_USED(AT_STD_DEVS) && (l->std_dev_slot >= 0)) {
        at_give(p, m, l->std_dev_slot, std_dev, oldest);
    }
    if (l->novelty_slot >= 0) {
        at_put(p, m, l->novelty_slot, novelty, oldest);
    }
}

/* ---- Votes. Of integers: how many runs there were and the number of the first that counts; where the oldest waiting truth lies and
 * how many wait; the state that is followed, another one and since when; times of runs; of waiting truths the arrival and the run; of
 * each ring of errors where the oldest lies and how many there are; arrivals of errors. Of numbers: rows of runs, waiting truths, squares
 * of errors; of each voter the sum and the mean of these and how many there are, and what it counts by its novelty.
 *
 * Where errors count for a time, all voters have one ring, and the square of one that said nothing is absent; else each has its own. Of
 * errors that fade each ring has the last. A hedge has no errors: its ring says whether a truth has come, and when; its squares are the
 * two sums of all voters, its sums those of each. */

#define AT_RUNS 0
#define AT_FIRST_RUN 1
#define AT_WAITING_FROM 2
#define AT_WAITING 3
#define AT_FOLLOWED 4
#define AT_OTHER 5
#define AT_SINCE 6
#define AT_RUN_TIMES 7

#define AT_HARMLESS AT_R(0.0)
#define AT_HARMS AT_R(1.0)
#define AT_UNKNOWN AT_R(2.0)
#define AT_NOVEL AT_R(3.0)

typedef struct {
    int32_t voters; /* that vote, and of which errors are kept: a guard compares each with predicting zero */
    int32_t judged;
    int64_t *run_times;
    int64_t *arrived;
    int64_t *run_of;
    int64_t *rings;
    int64_t *error_times;
    at_real *rows;
    at_real *truths;
    at_real *squares;
    at_real *sums;
    at_real *means;
    at_real *counts;
    at_real *trust;
    at_real *votes;
    at_real *weights;
} at_ballot;

static at_ballot at_ballot_of(const at_plan *p, const at_vote *v, at_memory m)
{
    at_ballot b;
    b.voters = p->gather[v->voters].count;
    b.judged = (v->rule == AT_GUARD) ? (2 * b.voters) : b.voters;
    b.run_times = &m.i[v->ints + AT_RUN_TIMES];
    b.arrived = &b.run_times[v->runs];
    b.run_of = &b.arrived[v->waiting];
    b.rings = &b.run_of[v->waiting];
    b.error_times = &b.rings[2 * v->rings];
    b.rows = &m.r[v->reals];
    b.truths = &b.rows[v->runs * b.voters];
    b.squares = &b.truths[v->waiting];
    b.sums = &b.squares[b.judged * v->errors];
    b.means = &b.sums[b.judged];
    b.counts = &b.means[b.judged];
    b.trust = &b.counts[b.judged];
    b.votes = &m.r[p->scratch];
    b.weights = &b.votes[b.voters];
    return b;
}

/* The ring of a voter. */
static int32_t at_ring(const at_vote *v, int32_t voter)
{
    return (v->memory == AT_BY_TIME) ? 0 : voter;
}

/* Where an error lies within a ring, the oldest being the first. */
static int32_t at_error_place(const at_vote *v, const at_ballot *b, int32_t ring, int64_t nth)
{
    int64_t place = b->rings[2 * ring] + nth;
    if (place >= (int64_t)v->errors) {
        place -= (int64_t)v->errors;
    }
    return (int32_t)place;
}

static at_real *at_square_of(const at_vote *v, const at_ballot *b, int32_t voter, int64_t nth)
{
    return &b->squares[(voter * v->errors) + at_error_place(v, b, at_ring(v, voter), nth)];
}

static void at_forget_error(const at_vote *v, const at_ballot *b, int32_t ring)
{
    b->rings[2 * ring] = (b->rings[2 * ring] + 1) % (int64_t)v->errors;
    b->rings[(2 * ring) + 1]--;
}

/* Takes the sum and the mean of what is in memory afresh, without the first so many. */
static void at_refresh(const at_vote *v, const at_ballot *b, int32_t voter, int64_t without)
{
    const int64_t rows = b->rings[(2 * at_ring(v, voter)) + 1];
    at_real sum = AT_R(0.0);
    at_real count = AT_R(0.0);
    int64_t nth;
    for (nth = without; nth < rows; nth++) {
        const at_real square = *at_square_of(v, b, voter, nth);
        if (at_is_absent(square) == 0) {
            sum = sum + square;
            count = count + AT_R(1.0);
        }
    }
    b->sums[voter] = sum;
    b->counts[voter] = count;
    b->means[voter] = (count > AT_R(0.0)) ? (sum / count) : AT_NAN;
}

/* What is left after a time of an error that fades. */
static at_real at_left(const at_vote *v, int64_t after)
{
    at_real left = AT_R(1.0);
    if (AT_IS_USED(AT_FADES)) {
        const at_real power = (at_real)at_exp2((double)(-at_seconds(after) / v->half_life));
        left = (power < left) ? power : left;
    }
    return left;
}

/* Lets the first so many errors of all voters go. */
static void at_forget_rows(const at_vote *v, const at_ballot *b, int64_t dropped)
{
    int32_t voter;
    for (voter = 0; voter < b->judged; voter++) {
        int any = 0;
        int64_t nth;
        for (nth = 0; nth < dropped; nth++) {
            if (at_is_absent(*at_square_of(v, b, voter, nth)) == 0) {
                any = 1;
            }
        }
        if (any != 0) {
            at_refresh(v, b, voter, dropped);
        }
    }
    b->rings[0] = (b->rings[0] + dropped) % (int64_t)v->errors;
    b->rings[1] -= dropped;
}

/* The square of the error of a voter; absent where it does not count. */
static at_real at_judged(const at_ballot *b, int32_t voter, const at_real row[], at_real truth)
{
    const at_real vote = (voter < b->voters) ? row[voter] : AT_R(0.0);
    at_real square = (vote - truth) * (vote - truth);
    if (!((truth * truth) <= AT_LARGEST) || (at_is_absent(row[voter % b->voters]) != 0)) {
        square = AT_NAN;
    } else if (square > AT_LARGEST) {
        square = AT_LARGEST;
    } else {
        /* It counts as it is. */
    }
    return square;
}

/* Remembers the errors of all voters at one truth, where they count for a time. */
static void at_remember_row(const at_vote *v, const at_ballot *b, at_memory m, const at_real row[], at_real truth,
                            int64_t arrived)
{
    int any = 0;
    int32_t voter;
    for (voter = 0; voter < b->judged; voter++) {
        if (at_is_absent(at_judged(b, voter, row, truth)) == 0) {
            any = 1;
        }
    }
    if (any == 0) {
        return;
    }
    if (b->rings[1] >= (int64_t)v->errors) {
        at_forget_rows(v, b, 1);
        m.i[AT_FLAGS] |= (int64_t)AT_FULL;
    }
    b->error_times[at_error_place(v, b, 0, b->rings[1])] = arrived;
    for (voter = 0; voter < b->judged; voter++) {
        const at_real square = at_judged(b, voter, row, truth);
        *at_square_of(v, b, voter, b->rings[1]) = square;
        if (at_is_absent(square) == 0) {
            b->sums[voter] = b->sums[voter] + square;
            b->counts[voter] = b->counts[voter] + AT_R(1.0);
            b->means[voter] = b->sums[voter] / b->counts[voter];
        }
    }
    b->rings[1]++;
}

/* Remembers an error of a voter that has a ring of its own. */
static void at_remember(const at_vote *v, const at_ballot *b, int32_t voter, at_real square, int64_t arrived)
{
    int64_t *ring = &b->rings[2 * voter];
    if (v->memory == AT_FADING) {
        const at_real left = (ring[1] > 0) ? at_left(v, at_minus(arrived, b->error_times[voter])) : AT_R(0.0);
        const at_real mean = (at_is_absent(b->means[voter]) != 0) ? square : b->means[voter];
        b->counts[voter] = (b->counts[voter] * left) + AT_R(1.0);
        b->means[voter] = mean + ((square - mean) / b->counts[voter]);
        b->error_times[voter] = arrived;
        b->squares[voter] = square;
        ring[1] = 1;
    } else {
        const int full = (ring[1] >= (int64_t)v->errors) ? 1 : 0;
        if (full != 0) {
            at_forget_error(v, b, voter);
        }
        b->error_times[(voter * v->errors) + at_error_place(v, b, voter, ring[1])] = arrived;
        *at_square_of(v, b, voter, ring[1]) = square;
        ring[1]++;
        if (full != 0) {
            at_refresh(v, b, voter, 0);
        } else {
            b->sums[voter] = b->sums[voter] + square;
            b->counts[voter] = b->counts[voter] + AT_R(1.0);
            b->means[voter] = b->sums[voter] / b->counts[voter];
        }
    }
}

static void at_observe_errors(const at_vote *v, const at_ballot *b, at_memory m, const at_real row[], at_real truth,
                              int64_t arrived)
{
    if (v->memory == AT_BY_TIME) {
        at_remember_row(v, b, m, row, truth, arrived);
    } else {
        int32_t voter;
        for (voter = 0; voter < b->judged; voter++) {
            const at_real square = at_judged(b, voter, row, truth);
            if (at_is_absent(square) == 0) {
                at_remember(v, b, voter, square, arrived);
            }
        }
    }
}

static int at_keeps_errors(const at_vote *v)
{
    return ((v->rule == AT_AUTO_WEIGHTED) || (v->rule == AT_BEST) || (v->rule == AT_GUARD)) ? 1 : 0;
}

/* What the voters of a hedge have lost beyond the best, the sum of what their mean has lost to their mixture, and their largest difference. */
#define AT_GAP 0
#define AT_WIDEST 1

/* The rate of a hedge, infinite while voters that are not the best deserve nothing. */
static at_real at_hedge_rate(const at_vote *v, const at_ballot *b)
{
    return at_over(v->rate, b->squares[(v->adaptive != 0) ? AT_GAP : AT_WIDEST]);
}

static void at_divide(const at_ballot *b, at_real total)
{
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        b->weights[voter] = at_over(b->weights[voter], total);
    }
}

static at_real at_hedge_share(at_real rate, at_real behind)
{
    return (behind == AT_R(0.0)) ? AT_R(1.0) : (at_real)at_exp((double)(-rate * behind));
}

static void at_hedge_weigh(const at_ballot *b, at_real rate)
{
    at_real best = (at_real)INFINITY;
    at_real total = AT_R(0.0);
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if ((at_is_absent(b->votes[voter]) == 0) && (b->sums[voter] < best)) {
            best = b->sums[voter];
        }
    }
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            b->weights[voter] = at_hedge_share(rate, b->sums[voter] - best);
            total = total + b->weights[voter];
        }
    }
    at_divide(b, total);
}

static at_real at_loss_of(const at_ballot *b, int32_t voter, at_real truth)
{
    return (b->votes[voter] - truth) * (b->votes[voter] - truth);
}

/* What the mixture of the voters has lost where each has lost so much; taken relative to the least. */
static at_real at_hedge_mix(const at_ballot *b, at_real rate, const at_real lost[])
{
    at_real least = (at_real)INFINITY;
    at_real sum = AT_R(-0.0);
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if ((at_is_absent(b->votes[voter]) == 0) && (lost[voter] < least)) {
            least = lost[voter];
        }
    }
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            sum = sum + at_hedge_share(rate, lost[voter] - least);
        }
    }
    return least - at_over((at_real)at_log((double)sum), rate);
}

/* Adds what the votes of a run have lost by a truth; those that were absent lose what the others do. */
static void at_hedge_lose(const at_vote *v, const at_ballot *b, at_real truth)
{
    at_real least = (at_real)INFINITY;
    at_real most = -(at_real)INFINITY;
    at_real mean = AT_R(-0.0);
    at_real best = (at_real)INFINITY;
    at_real mixed;
    at_real rate;
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            const at_real loss = at_loss_of(b, voter, truth);
            least = (loss < least) ? loss : least;
            most = (loss > most) ? loss : most;
        }
    }
    if (!isfinite(most - least)) {
        return;
    }
    if ((most - least) > b->squares[AT_WIDEST]) {
        b->squares[AT_WIDEST] = most - least;
    }
    rate = at_hedge_rate(v, b);
    at_hedge_weigh(b, rate);
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            const at_real loss = at_loss_of(b, voter, truth) - least;
            mean = mean + (b->weights[voter] * loss);
            b->weights[voter] = b->sums[voter] + loss;
        }
    }
    mixed = at_hedge_mix(b, rate, b->weights) - at_hedge_mix(b, rate, b->sums);
    /* Written so that what is none counts as 0. */
    if (!(mixed > AT_R(0.0))) {
        mixed = AT_R(0.0);
    }
    if ((mean - mixed) > AT_R(0.0)) {
        b->squares[AT_GAP] = b->squares[AT_GAP] + (mean - mixed);
    }
    for (voter = 0; voter < b->voters; voter++) {
        b->sums[voter] = (at_is_absent(b->votes[voter]) != 0) ? (b->sums[voter] + mixed) : b->weights[voter];
        best = (b->sums[voter] < best) ? b->sums[voter] : best;
    }
    for (voter = 0; voter < b->voters; voter++) {
        b->sums[voter] = b->sums[voter] - best;
    }
}

static void at_hedge_observe(const at_vote *v, const at_ballot *b, const at_real row[], at_real truth, int64_t arrived)
{
    int32_t voter;
    if ((v->half_life > AT_R(0.0)) && (b->rings[1] > 0)) {
        const at_real left = at_left(v, at_minus(arrived, b->error_times[0]));
        b->squares[AT_GAP] = b->squares[AT_GAP] * left;
        b->squares[AT_WIDEST] = b->squares[AT_WIDEST] * left;
        for (voter = 0; voter < b->voters; voter++) {
            b->sums[voter] = b->sums[voter] * left;
        }
    }
    b->rings[1] = 1;
    b->error_times[0] = arrived;
    for (voter = 0; voter < b->voters; voter++) {
        b->votes[voter] = row[voter];
    }
    at_hedge_lose(v, b, truth);
}

/* Hands over every truth that arrived up to `newest`. */
static void at_hand_over(const at_vote *v, const at_ballot *b, at_memory m, int64_t newest)
{
    while (m.i[v->ints + AT_WAITING] > 0) {
        const int32_t place = (int32_t)m.i[v->ints + AT_WAITING_FROM];
        const int64_t run = b->run_of[place];
        const int64_t kept = m.i[v->ints + AT_RUNS] - run;
        const at_real *row = &b->rows[(int32_t)(run % (int64_t)v->runs) * b->voters];
        if (b->arrived[place] > newest) {
            break;
        }
        m.i[v->ints + AT_WAITING_FROM] = ((int64_t)place + 1) % (int64_t)v->waiting;
        m.i[v->ints + AT_WAITING]--;
        if (kept > (int64_t)v->runs) {
            m.i[AT_FLAGS] |= (int64_t)AT_FULL;
        } else if (at_keeps_errors(v) != 0) {
            at_observe_errors(v, b, m, row, b->truths[place], b->arrived[place]);
        } else if (AT_IS_USED(AT_HEDGES) && (v->rule == AT_HEDGE)) {
            at_hedge_observe(v, b, row, b->truths[place], b->arrived[place]);
        } else {
            /* It goes by no truths. */
        }
    }
}

static void at_forget_errors(const at_vote *v, const at_ballot *b, int64_t newest)
{
    const int64_t forgotten = at_minus(newest, v->longest);
    if (v->memory == AT_BY_TIME) {
        int64_t dropped = 0;
        while ((dropped < b->rings[1]) && (b->error_times[at_error_place(v, b, 0, dropped)] <= forgotten)) {
            dropped++;
        }
        if (dropped > 0) {
            at_forget_rows(v, b, dropped);
        }
    } else if (v->memory == AT_FADING) {
        int32_t voter;
        for (voter = 0; voter < b->judged; voter++) {
            if ((b->rings[(2 * voter) + 1] > 0) && (b->error_times[voter] <= forgotten)) {
                at_forget_error(v, b, voter);
                at_refresh(v, b, voter, 0);
            }
        }
    } else {
        /* So many count, however old they are. */
    }
}

/* How many errors of a voter there are: of those that fade, what they come to by now. */
static at_real at_errors_of(const at_vote *v, const at_ballot *b, int32_t voter, int64_t newest)
{
    at_real count = b->counts[voter];
    if ((v->memory == AT_FADING) && (b->rings[(2 * voter) + 1] > 0)) {
        const int64_t idle = at_minus(newest, b->error_times[voter]);
        count = count * at_left(v, (idle > 0) ? idle : 0);
    }
    return count;
}

static at_real at_mean_of(const at_ballot *b)
{
    at_real sum = AT_R(0.0);
    at_real count = AT_R(0.0);
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            sum = sum + b->votes[voter];
            count = count + AT_R(1.0);
        }
    }
    return (count > AT_R(0.0)) ? (sum / count) : AT_NAN;
}

static int32_t at_present(const at_ballot *b)
{
    int32_t count = 0;
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            count++;
        }
    }
    return count;
}

static void at_all_on(const at_ballot *b, int32_t chosen)
{
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            b->weights[voter] = (voter == chosen) ? AT_R(1.0) : AT_R(0.0);
        }
    }
}

/* Whether any voter is outside of its fit. */
static int at_any_outside(const at_vote *v, const at_ballot *b)
{
    int any = 0;
    int32_t voter;
    if (v->novelties >= 0) {
        for (voter = 0; voter < b->voters; voter++) {
            if (b->trust[voter] != AT_R(1.0)) {
                any = 1;
            }
        }
    }
    return any;
}

/* Lets each vote count by its novelty; the sum of the weights. */
static at_real at_distrust(const at_ballot *b)
{
    at_real total = AT_R(-0.0);
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            b->weights[voter] = b->weights[voter] * b->trust[voter];
            total = total + b->weights[voter];
        }
    }
    return total;
}

/* Draws weights towards equal ones, and makes them add up to one. */
static void at_shrink(const at_vote *v, const at_ballot *b)
{
    const at_real count = (at_real)at_present(b);
    at_real total = AT_R(-0.0);
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            total = total + b->weights[voter];
        }
    }
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            const at_real own = (total > AT_R(0.0)) ? (b->weights[voter] / total) : (AT_R(1.0) / count);
            b->weights[voter] = ((AT_R(1.0) - v->shrinkage) * own) + (v->shrinkage / count);
        }
    }
}

/* Lifts weights that add up to one to a floor, at the cost of the larger ones. */
static void at_raise(const at_vote *v, const at_ballot *b)
{
    const int32_t count = at_present(b);
    at_real scale = AT_R(1.0);
    int32_t turn;
    int32_t voter;
    if (!(v->floor > AT_R(0.0))) {
        return;
    }
    if ((v->floor * (at_real)count) >= AT_R(1.0)) {
        for (voter = 0; voter < b->voters; voter++) {
            if (at_is_absent(b->votes[voter]) == 0) {
                b->weights[voter] = AT_R(1.0) / (at_real)count;
            }
        }
        return;
    }
    for (turn = 0; turn < count; turn++) {
        at_real above = AT_R(0.0);
        at_real below = AT_R(0.0);
        for (voter = 0; voter < b->voters; voter++) {
            if (at_is_absent(b->votes[voter]) == 0) {
                if ((b->weights[voter] * scale) < v->floor) {
                    below = below + v->floor;
                } else {
                    above = above + b->weights[voter];
                }
            }
        }
        scale = at_over(AT_R(1.0) - below, above);
    }
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            const at_real weight = b->weights[voter] * scale;
            b->weights[voter] = (weight > v->floor) ? weight : v->floor;
        }
    }
}

static at_real at_weight_of(const at_vote *v, at_real mean, at_real best, at_real roots, at_real known)
{
    at_real weight;
    if (v->form == AT_INVERSE_POWER) {
        const at_real ratio = best / ((mean > AT_SMALLEST) ? mean : AT_SMALLEST);
        /* Of the mean square, so half of the power. */
        weight = ratio;
        if (AT_IS_USED(AT_ANY_POWER) && (v->power != AT_R(1.0))) {
            weight = (at_real)at_pow((double)ratio, (double)v->power);
        }
    } else if (roots > AT_R(0.0)) {
        weight = mean / (roots * roots);
    } else {
        weight = AT_R(1.0) / (known * known);
    }
    return weight;
}

/* Weighs votes by the errors in memory; what the weights are to be divided by. */
static at_real at_weigh(const at_vote *v, const at_ballot *b)
{
    at_real best = (at_real)INFINITY;
    at_real roots = AT_R(-0.0);
    at_real total = AT_R(0.0);
    at_real count = AT_R(0.0);
    at_real present = AT_R(0.0);
    at_real known = AT_R(0.0);
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if ((at_is_absent(b->votes[voter]) == 0) && (at_is_absent(b->means[voter]) == 0)) {
            if (b->means[voter] < best) {
                best = b->means[voter];
            }
            roots = roots + at_root(b->means[voter]);
            known = known + AT_R(1.0);
        }
    }
    if (!(best > AT_SMALLEST)) {
        best = AT_SMALLEST;
    }
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            present = present + AT_R(1.0);
            if (at_is_absent(b->means[voter]) == 0) {
                b->weights[voter] = at_weight_of(v, b->means[voter], best, roots, known);
                total = total + b->weights[voter];
                count = count + AT_R(1.0);
            }
        }
    }
    if (count < present) {
        const at_real of_unknown = (count > AT_R(0.0)) ? (total / count) : AT_R(1.0);
        total = AT_R(0.0);
        for (voter = 0; voter < b->voters; voter++) {
            if (at_is_absent(b->votes[voter]) == 0) {
                if (at_is_absent(b->means[voter]) != 0) {
                    b->weights[voter] = of_unknown;
                }
                total = total + b->weights[voter];
            }
        }
    }
    if ((v->form == AT_AS_PRINTED_RAW) && (count > AT_R(0.0))) {
        total = AT_R(1.0);
    } else if ((v->shrinkage > AT_R(0.0)) || (v->floor > AT_R(0.0))) {
        at_shrink(v, b);
        at_raise(v, b);
        total = AT_R(1.0);
    } else {
        /* As they are. */
    }
    if ((v->form != AT_AS_PRINTED_RAW) && (at_any_outside(v, b) != 0)) {
        total = at_distrust(b);
    }
    return total;
}

static at_real at_auto_weighted(const at_vote *v, const at_ballot *b)
{
    const at_real total = at_weigh(v, b);
    at_real sum = AT_R(0.0);
    int any = 0;
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            sum = sum + (b->weights[voter] * b->votes[voter]);
            any = 1;
        }
    }
    at_divide(b, total);
    return ((any != 0) && (total != AT_R(0.0))) ? (sum / total) : AT_NAN;
}

static at_real at_hedge(const at_vote *v, const at_ballot *b)
{
    at_real sum = AT_R(-0.0);
    int32_t voter;
    if (at_present(b) == 0) {
        return AT_NAN;
    }
    at_hedge_weigh(b, at_hedge_rate(v, b));
    at_raise(v, b);
    if (at_any_outside(v, b) != 0) {
        at_divide(b, at_distrust(b));
    }
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            sum = sum + (b->weights[voter] * b->votes[voter]);
        }
    }
    return sum;
}

/* The mean of the votes in the middle. */
static at_real at_middle(const at_vote *v, const at_ballot *b)
{
    at_real *sorted = &b->weights[b->voters];
    const int32_t count = at_present(b);
    int32_t away = (int32_t)floor((double)(v->share * (at_real)count));
    const int32_t most = ((count > 0) ? (count - 1) : 0) / 2;
    at_real sum = AT_R(-0.0);
    int32_t voter;
    int32_t nth = 0;
    if (away > most) {
        away = most;
    }
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            sorted[nth] = b->votes[voter];
            nth++;
        }
    }
    at_sort(sorted, count);
    for (nth = away; nth < (count - away); nth++) {
        sum = sum + sorted[nth];
    }
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            int32_t rank = 0;
            int32_t other;
            for (other = 0; other < b->voters; other++) {
                if ((at_is_absent(b->votes[other]) == 0)
                    && ((at_before(b->votes[other], b->votes[voter]) != 0)
                        || ((other < voter) && (at_before(b->votes[voter], b->votes[other]) == 0)))) {
                    rank++;
                }
            }
            b->weights[voter] = ((rank >= away) && (rank < (count - away)))
                                    ? (AT_R(1.0) / (at_real)(count - (2 * away)))
                                    : AT_R(0.0);
        }
    }
    return at_over(sum, (at_real)(count - (2 * away)));
}

static int32_t at_best(const at_vote *v, const at_ballot *b)
{
    const int outside = at_any_outside(v, b);
    at_real least = AT_NAN;
    int32_t chosen = -1;
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            const at_real trust = (outside != 0) ? b->trust[voter] : AT_R(1.0);
            const at_real error =
                (at_is_absent(b->means[voter]) != 0) ? (at_real)INFINITY : at_over(b->means[voter], trust);
            if ((chosen < 0) || (error < least)) {
                chosen = voter;
                least = error;
            }
        }
    }
    return chosen;
}

static at_real at_judge(const at_vote *v, const at_ballot *b, int64_t newest)
{
    const int outside = at_any_outside(v, b);
    at_real judged = AT_HARMLESS;
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            const int32_t zero = b->voters + voter;
            if ((outside != 0) && (b->trust[voter] < v->least_trust)) {
                judged = AT_NOVEL;
                break;
            }
            if ((at_is_absent(b->means[voter]) == 0) && (at_is_absent(b->means[zero]) == 0)
                && (at_errors_of(v, b, zero, newest) >= v->min_truths)) {
                if (b->means[voter] >= b->means[zero]) {
                    judged = AT_HARMS;
                    break;
                }
            } else {
                judged = AT_UNKNOWN;
            }
        }
    }
    return judged;
}

static at_real at_guard(const at_vote *v, const at_ballot *b, int64_t newest, at_real *reason)
{
    const int32_t count = at_present(b);
    const at_real judged = at_judge(v, b, newest);
    const int passes = ((judged == AT_HARMS) || (judged == AT_NOVEL)) ? 0 : 1;
    at_real value = at_mean_of(b);
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            b->weights[voter] = ((passes != 0) ? AT_R(1.0) : AT_R(0.0)) / (at_real)count;
        }
    }
    if (count > 0) {
        *reason = judged;
        if (passes == 0) {
            value = AT_R(0.0);
        }
    }
    return value;
}

/* Follows the state of stability that a gate goes by. */
static void at_follow(const at_vote *v, at_memory m, at_real state)
{
    int64_t *followed = &m.i[v->ints + AT_FOLLOWED];
    int64_t *other = &m.i[v->ints + AT_OTHER];
    int64_t *since = &m.i[v->ints + AT_SINCE];
    const int64_t now = m.i[AT_LAST];
    if ((at_is_absent(state) != 0) || (state < AT_R(0.0))) {
        *followed = -1;
        *other = -1;
    } else {
        const double rounded = round((double)state);
        const int64_t found = (rounded > 1.0e15) ? INT64_C(1000000000000000) : (int64_t)rounded;
        if (*followed == found) {
            *other = -1;
        } else if ((*followed >= 0) && (*other == found)) {
            if (at_minus(now, *since) >= v->dwell) {
                *followed = found;
                *other = -1;
            }
        } else if ((*followed >= 0) && (v->dwell > 0)) {
            *other = found;
            *since = now;
        } else {
            *followed = found;
            *other = -1;
        }
    }
}

static at_real at_state_gate(const at_vote *v, const at_ballot *b, at_memory m, at_real *reason)
{
    const int64_t followed = m.i[v->ints + AT_FOLLOWED];
    const int64_t most = (b->voters > 0) ? ((int64_t)b->voters - 1) : 0;
    const int32_t own = (int32_t)((followed < 0) ? 0 : ((followed < most) ? followed : most));
    int32_t chosen = -1;
    int32_t last = -1;
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if (at_is_absent(b->votes[voter]) == 0) {
            if ((chosen < 0) && (voter >= own)) {
                chosen = voter;
            }
            last = voter;
        }
    }
    if (chosen < 0) {
        chosen = last;
    }
    at_all_on(b, chosen);
    if (chosen >= 0) {
        *reason = (followed < 0) ? AT_R(2.0) : ((chosen == own) ? AT_R(0.0) : AT_R(1.0));
    }
    return (chosen >= 0) ? b->votes[chosen] : AT_NAN;
}

static at_real at_combine(const at_vote *v, const at_ballot *b, at_memory m, at_real *reason)
{
    at_real value = AT_NAN;
    int32_t chosen = -1;
    int32_t voter;
    if (v->rule == AT_AUTO_WEIGHTED) {
        value = at_auto_weighted(v, b);
    } else if (v->rule == AT_MIDDLE) {
        value = at_middle(v, b);
    } else if (v->rule == AT_GUARD) {
        value = at_guard(v, b, at_minus(m.i[AT_LAST], v->embargo), reason);
    } else if (AT_IS_USED(AT_HEDGES) && (v->rule == AT_HEDGE)) {
        value = at_hedge(v, b);
    } else if (v->rule == AT_STATE_GATE) {
        value = at_state_gate(v, b, m, reason);
    } else if (v->rule == AT_MEAN) {
        const at_real count = (at_real)at_present(b);
        value = at_mean_of(b);
        for (voter = 0; voter < b->voters; voter++) {
            if (at_is_absent(b->votes[voter]) == 0) {
                b->weights[voter] = AT_R(1.0) / count;
            }
        }
    } else {
        if (v->rule == AT_BEST) {
            chosen = at_best(v, b);
        } else {
            for (voter = b->voters - 1; voter >= 0; voter--) {
                if (at_is_absent(b->votes[voter]) == 0) {
                    chosen = voter;
                }
            }
        }
        at_all_on(b, chosen);
        value = (chosen >= 0) ? b->votes[chosen] : AT_NAN;
    }
    return value;
}

static void at_heed(const at_plan *p, const at_vote *v, const at_ballot *b, at_memory m, at_real novelty[])
{
    int32_t nth;
    for (nth = 0; nth < b->voters; nth++) {
        novelty[nth] = AT_NAN;
    }
    if (v->novelties >= 0) {
        for (nth = 0; nth < p->gather[v->novelties].count; nth++) {
            int64_t stamp;
            novelty[v->which[nth]] = at_port(p, m, v->novelties, nth, &stamp);
        }
        for (nth = 0; nth < b->voters; nth++) {
            b->trust[nth] = (novelty[nth] > AT_R(1.0)) ? (AT_R(1.0) / (novelty[nth] * novelty[nth])) : AT_R(1.0);
        }
    }
}

static void at_write_run(const at_vote *v, const at_ballot *b, at_memory m)
{
    const int32_t place = (int32_t)(m.i[v->ints + AT_RUNS] % (int64_t)v->runs);
    int32_t voter;
    b->run_times[place] = m.i[AT_LAST];
    for (voter = 0; voter < b->voters; voter++) {
        b->rows[(place * b->voters) + voter] = b->votes[voter];
    }
    m.i[v->ints + AT_RUNS]++;
}

/* The standard deviation of the truth about a combination, which follows one of the votes with the probability of its weight. */
static at_real at_std_dev_of_votes(const at_plan *p, const at_vote *v, const at_ballot *b, at_memory m, at_real value)
{
    at_real sum = AT_R(0.0);
    at_real variance = AT_R(0.0);
    int32_t voter;
    for (voter = 0; voter < b->voters; voter++) {
        if ((b->weights[voter] != AT_R(0.0)) && (at_is_absent(b->votes[voter]) == 0)) {
            int64_t stamp;
            const at_real own = at_port(p, m, v->std_devs, voter, &stamp);
            const at_real off = b->votes[voter] - value;
            sum = sum + b->weights[voter];
            variance = variance + (b->weights[voter] * ((own * own) + (off * off)));
        }
    }
    /* Written so that what is no number fails. */
    return ((at_size(sum - AT_R(1.0)) < AT_R(1.0e-9)) && (variance >= AT_R(0.0))) ? at_root(variance) : AT_NAN;
}

static void at_run_vote(const at_plan *p, const at_vote *v, at_memory m)
{
    const at_ballot b = at_ballot_of(p, v, m);
    at_real *novelty = &b.weights[2 * b.voters];
    const int64_t now = m.i[AT_LAST];
    int fresh = at_gather_is(p, m, v->voters, AT_FRESH);
    at_real reason = AT_NAN;
    at_real value;
    int64_t stamp;
    int32_t voter;
    if (v->truth >= 0) {
        const int64_t newest = at_minus(now, v->embargo);
        at_hand_over(v, &b, m, newest);
        if (at_keeps_errors(v) != 0) {
            at_forget_errors(v, &b, newest);
        }
    }
    if (v->state >= 0) {
        at_follow(v, m, at_port(p, m, v->state, 0, &stamp));
        if (at_gather_is(p, m, v->state, AT_FRESH) != 0) {
            fresh = 1;
        }
    }
    if (fresh == 0) {
        return;
    }
    for (voter = 0; voter < b.voters; voter++) {
        b.votes[voter] = at_port(p, m, v->voters, voter, &stamp);
        b.weights[voter] = AT_NAN;
    }
    at_heed(p, v, &b, m, novelty);
    value = at_combine(v, &b, m, &reason);
    if (v->truth >= 0) {
        at_write_run(v, &b, m);
    }
    stamp = at_oldest(p, m, v->voters, now);
    at_give(p, m, v->slot, value, stamp);
    if (v->weights_slot >= 0) {
        for (voter = 0; voter < b.voters; voter++) {
            at_give(p, m, v->weights_slot + voter, b.weights[voter], stamp);
        }
    }
    if (v->reason_slot >= 0) {
        at_give(p, m, v->reason_slot, reason, stamp);
    }
    if (v->novelty_slot >= 0) {
        at_real sum = AT_R(0.0);
        at_real known = AT_R(0.0);
        for (voter = 0; voter < b.voters; voter++) {
            if ((b.weights[voter] > AT_R(0.0)) && (at_is_absent(novelty[voter]) == 0)) {
                sum = sum + (b.weights[voter] * novelty[voter]);
                known = known + b.weights[voter];
            }
        }
        at_give(p, m, v->novelty_slot, at_over(sum, known), stamp);
    }
    if (AT_IS_USED(AT_STD_DEVS) && (v->std_dev_slot >= 0)) {
        at_give(p, m, v->std_dev_slot, at_std_dev_of_votes(p, v, &b, m, at_unless_infinite(value)), stamp);
    }
}

/* Takes a truth that has just been measured, now that all outputs are there. */
static void at_take_truth(const at_plan *p, const at_vote *v, at_memory m)
{
    const at_ballot b = at_ballot_of(p, v, m);
    const int64_t run = at_run_at(m, b.run_times, v->runs, m.i[v->ints + AT_FIRST_RUN], m.i[v->ints + AT_RUNS],
                                  at_minus(m.i[AT_LAST], v->ahead), v->limit);
    if (run >= 0) {
        const int32_t place = at_wait(m, &m.i[v->ints + AT_WAITING_FROM], v->waiting);
        b.arrived[place] = m.i[AT_LAST];
        b.run_of[place] = run;
        b.truths[place] = at_value(p, m, v->truth);
    }
}

static void at_segment_vote(const at_plan *p, const at_vote *v, at_memory m)
{
    const at_ballot b = at_ballot_of(p, v, m);
    if (v->truth >= 0) {
        at_hand_over(v, &b, m, m.i[AT_LAST]);
        m.i[v->ints + AT_FIRST_RUN] = m.i[v->ints + AT_RUNS];
    }
}

/* Moves what is remembered to the clock of the segment that begins. */
static void at_shift_vote(const at_plan *p, const at_vote *v, at_memory m, int64_t shift)
{
    const at_ballot b = at_ballot_of(p, v, m);
    int32_t ring;
    m.i[v->ints + AT_FOLLOWED] = -1;
    m.i[v->ints + AT_OTHER] = -1;
    for (ring = 0; ring < v->rings; ring++) {
        int64_t nth;
        for (nth = 0; nth < b.rings[(2 * ring) + 1]; nth++) {
            int64_t *arrived = &b.error_times[(ring * v->errors) + at_error_place(v, &b, ring, nth)];
            *arrived = at_plus(*arrived, shift);
        }
    }
}

static void at_begin_vote(const at_plan *p, const at_vote *v, at_memory m)
{
    const at_ballot b = at_ballot_of(p, v, m);
    int32_t voter;
    m.i[v->ints + AT_FOLLOWED] = -1;
    m.i[v->ints + AT_OTHER] = -1;
    for (voter = 0; voter < b.judged; voter++) {
        b.means[voter] = AT_NAN;
    }
    for (voter = 0; voter < b.voters; voter++) {
        b.trust[voter] = AT_R(1.0);
    }
}

/* ---- Compensation. Of integers: whether there was a tick, and when; of each axis whether it has a rate, and whether it is stopped. Of
 * numbers: of each axis minus the integral, what was given, and the rate. */

static at_real at_axis(const at_compensate_limits *l, int64_t *flags, at_real *axis, at_real given_rate, at_real dt,
                       int stable)
{
    at_real rate = given_rate;
    at_real reason = AT_R(0.0);
    const at_real size = at_size(rate);
    const at_real before = axis[2];
    if (at_is_absent(rate) != 0) {
        flags[0] = 0;
        return AT_R(1.0);
    }
    if (l->stops != 0) {
        flags[1] = (((flags[1] != 0) && (size <= l->above)) || ((flags[1] == 0) && (size < l->below))) ? 1 : 0;
    }
    if ((stable != 0) || (flags[1] != 0)) {
        reason = AT_R(2.0);
        rate = AT_R(0.0);
    } else if (size < l->deadband) {
        reason = AT_R(3.0);
        rate = AT_R(0.0);
    } else if (size > l->rate) {
        reason = AT_R(4.0);
        rate = at_signed(l->rate, rate);
    } else {
        /* It is followed. */
    }
    axis[2] = rate;
    if (flags[0] == 0) {
        flags[0] = 1;
    } else {
        const at_real wanted = axis[0] - ((AT_R(0.5) * (before + rate)) * dt);
        const at_real step = l->slew * dt;
        at_real missing;
        axis[0] = wanted;
        if (wanted < -l->range) {
            axis[0] = -l->range;
        }
        if (wanted > l->range) {
            axis[0] = l->range;
        }
        if (axis[0] != wanted) {
            reason = AT_R(5.0);
        }
        missing = axis[0] - axis[1];
        if (at_size(missing) > step) {
            reason = AT_R(6.0);
            axis[1] = axis[1] + at_signed(step, missing);
        } else {
            axis[1] = axis[0];
        }
    }
    return reason;
}

static void at_run_compensate(const at_plan *p, const at_compensate *c, at_memory m)
{
    const int64_t now = m.i[AT_LAST];
    const int64_t passed = at_minus(now, m.i[c->ints + 1]);
    const int has_last = (m.i[c->ints] != 0) ? 1 : 0;
    const int bridged = ((has_last != 0) && (passed <= c->max_gap)) ? 1 : 0;
    const at_real dt = (has_last != 0) ? at_seconds(passed) : AT_R(0.0);
    int32_t nth;
    m.i[c->ints] = 1;
    m.i[c->ints + 1] = now;
    for (nth = 0; nth < c->channels; nth++) {
        int64_t *flags = &m.i[c->ints + 2 + (2 * nth)];
        at_real *axis = &m.r[c->reals + (3 * nth)];
        int there;
        int64_t stamp;
        const at_real state = at_port_for(p, m, c->state, nth, &there);
        const int stable = ((there != 0) && (state >= AT_R(0.0)) && (state < AT_R(3.0))
                            && (c->stops[(int32_t)state] != 0))
                               ? 1
                               : 0;
        at_real rate = at_port(p, m, c->rate, nth, &stamp) * c->limits[nth].factor;
        at_real mark;
        at_real reason;
        if (bridged == 0) {
            flags[0] = 0;
        }
        if (!isfinite(rate)) {
            rate = AT_NAN;
        }
        reason = at_axis(&c->limits[nth], flags, axis, rate, dt, stable);
        mark = at_port_for(p, m, c->realigned, nth, &there);
        if ((there != 0) && (at_is_absent(mark) == 0) && (mark != AT_R(0.0))) {
            axis[0] = AT_R(0.0);
            axis[1] = AT_R(0.0);
        }
        at_give(p, m, c->slot + nth, axis[1], now);
        at_give(p, m, c->slot + c->channels + nth, reason, now);
    }
}

static void at_begin_compensate(const at_compensate *c, at_memory m)
{
    int32_t nth;
    for (nth = 0; nth < (2 + (2 * c->channels)); nth++) {
        m.i[c->ints + nth] = 0;
    }
    for (nth = 0; nth < (3 * c->channels); nth++) {
        m.r[c->reals + nth] = AT_R(0.0);
    }
}

/* ---- Stability. Of integers, of each axis: its state or -1, another one or -1, and since when that lasts. */

static void at_run_stability(const at_plan *p, const at_stability *s, at_memory m)
{
    const int64_t now = m.i[AT_LAST];
    int ran = 0;
    int64_t worst = 0;
    int32_t nth;
    for (nth = 0; nth < s->channels; nth++) {
        int64_t *axis = &m.i[s->ints + (3 * nth)];
        const at_entry *e = at_entry_of(p, s->gather, nth);
        if (at_ran(p, m, e->slot) != 0) {
            int64_t stamp;
            const at_real drift = at_size(at_read(p, m, e, 0, &stamp));
            ran = 1;
            if (at_is_absent(drift) != 0) {
                axis[0] = -1;
                axis[1] = -1;
            } else {
                const at_real calm = (axis[0] > 0) ? s->hysteresis[nth] : AT_R(0.0);
                const at_real rough = (axis[0] > 1) ? s->hysteresis[nth] : AT_R(0.0);
                const int64_t found =
                    (drift < (s->stable[nth] - calm)) ? 0 : ((drift < (s->transient[nth] - rough)) ? 1 : 2);
                if (axis[0] < 0) {
                    axis[0] = found;
                } else if (found == axis[0]) {
                    axis[1] = -1;
                } else {
                    if (axis[1] != found) {
                        axis[1] = found;
                        axis[2] = now;
                    }
                    if (at_minus(now, axis[2]) >= s->dwell) {
                        axis[0] = found;
                        axis[1] = -1;
                    }
                }
            }
            at_give(p, m, s->slot + nth, (axis[0] < 0) ? AT_NAN : (at_real)axis[0], now);
        }
        if ((axis[0] < 0) || (worst < 0)) {
            worst = -1;
        } else if (axis[0] > worst) {
            worst = axis[0];
        } else {
            /* Another is worse. */
        }
    }
    if (ran != 0) {
        at_give(p, m, s->slot + s->channels, (worst < 0) ? AT_NAN : (at_real)worst, now);
    }
}

static void at_begin_stability(const at_stability *s, at_memory m)
{
    int32_t nth;
    for (nth = 0; nth < s->channels; nth++) {
        m.i[s->ints + (3 * nth)] = -1;
        m.i[s->ints + (3 * nth) + 1] = -1;
        m.i[s->ints + (3 * nth) + 2] = 0;
    }
}

/* ---- Safe states. Of integers: whether there was a tick, and when; of each channel ticks without trust, whether it has left the
 * signal, and whether it has begun. Of numbers: what was given. */

static int at_approach(at_real *given, at_real goal, at_real step)
{
    const at_real missing = goal - *given;
    int there = 1;
    if (at_size(missing) > step) {
        *given = *given + at_signed(step, missing);
        there = 0;
    } else {
        *given = goal;
    }
    return there;
}

static void at_run_safe_state(const at_plan *p, const at_safe_state *s, at_memory m)
{
    const int64_t now = m.i[AT_LAST];
    const int64_t passed = (m.i[s->ints] != 0) ? at_minus(now, m.i[s->ints + 1]) : 0;
    const at_real dt = at_seconds((passed < s->max_gap) ? passed : s->max_gap);
    int32_t nth;
    m.i[s->ints] = 1;
    m.i[s->ints + 1] = now;
    for (nth = 0; nth < s->channels; nth++) {
        int64_t *known = &m.i[s->ints + 2 + (3 * nth)];
        at_real *given = &m.r[s->reals + nth];
        int there;
        int64_t stamp;
        const at_real signal = at_port(p, m, s->signal, nth, &stamp);
        const at_real mark = at_port_for(p, m, s->distrust, nth, &there);
        const int distrusted = ((there != 0) && !(mark == AT_R(0.0))) ? 1 : 0;
        at_real why;
        if (isfinite(signal) && (distrusted == 0)) {
            int arrived = 1;
            known[0] = 0;
            if (known[1] != 0) {
                arrived = at_approach(given, signal, s->slew[nth] * dt);
            } else {
                *given = signal;
            }
            known[1] = (arrived == 0) ? 1 : 0;
            known[2] = 1;
            why = (arrived != 0) ? AT_R(0.0) : AT_R(5.0);
        } else {
            why = (distrusted != 0) ? AT_R(2.0) : AT_R(1.0);
            if (known[0] < INT64_C(0xffffffff)) {
                known[0]++;
            }
            if (known[0] > s->after) {
                known[1] = known[2];
                (void)at_approach(given, (at_is_absent(s->when_lost[nth]) != 0) ? *given : s->when_lost[nth],
                                  s->slew[nth] * dt);
                why = why + AT_R(2.0);
            }
        }
        at_give(p, m, s->slot + nth, *given, now);
        at_give(p, m, s->slot + s->channels + nth, why, now);
    }
}

static void at_begin_safe_state(const at_safe_state *s, at_memory m)
{
    int32_t nth;
    for (nth = 0; nth < (2 + (3 * s->channels)); nth++) {
        m.i[s->ints + nth] = 0;
    }
    for (nth = 0; nth < s->channels; nth++) {
        m.r[s->reals + nth] = (at_is_absent(s->when_lost[nth]) != 0) ? AT_R(0.0) : s->when_lost[nth];
    }
}

/* ---- Positions without the correction. Of integers: for which channels a correction has been reported. */

static void at_run_uncorrected(const at_plan *p, const at_uncorrected *u, at_memory m)
{
    int32_t nth;
    for (nth = 0; nth < u->channels; nth++) {
        const at_entry *e = at_entry_of(p, u->position, nth);
        int64_t stamp;
        const at_real applied = at_port(p, m, u->applied, nth, &stamp);
        if (at_is_absent(applied) == 0) {
            m.i[u->ints + nth] = 1;
        }
        if (at_ran(p, m, e->slot) != 0) {
            const at_real position = at_read(p, m, e, 0, &stamp);
            const at_real by = (m.i[u->ints + nth] != 0) ? (applied * u->factors[nth]) : AT_R(0.0);
            const at_real value = position - by;
            at_put(p, m, u->slot + nth, isfinite(value) ? value : AT_NAN, stamp);
        }
    }
}

static void at_begin_uncorrected(const at_uncorrected *u, at_memory m)
{
    int32_t nth;
    for (nth = 0; nth < u->channels; nth++) {
        m.i[u->ints + nth] = (int64_t)u->from_start;
    }
}

/* ---- Optical loss. */

static void at_run_loss(const at_plan *p, const at_loss *l, at_memory m)
{
    const int64_t now = m.i[AT_LAST];
    at_real total = AT_R(0.0);
    int64_t stamp;
    int32_t nth;
    if (at_gather_is(p, m, l->gather, AT_FRESH | AT_ENDED) == 0) {
        return;
    }
    stamp = at_oldest(p, m, l->gather, now);
    for (nth = 0; nth < l->channels; nth++) {
        int64_t own;
        const at_real drift = at_port(p, m, l->gather, nth, &own);
        const at_real share = (l->coefficients[nth] * drift) * drift;
        total = total + share;
        at_give(p, m, l->slot + 1 + nth, share, stamp);
    }
    at_give(p, m, l->slot, total, stamp);
}

/* ---- Settle times. Of integers, each but the third behind whether it is known: the set point, its change, whether it is waited for,
 * since when the loss is low, when its newest value came. Of numbers: where the set point stood. */

#define AT_HAS_STOOD 0
#define AT_HAS_CHANGED 1
#define AT_CHANGED 2
#define AT_AWAITED 3
#define AT_HAS_LOW 4
#define AT_LOW 5
#define AT_HAS_NEWEST 6
#define AT_NEWEST_LOSS 7

static void at_set_point(const at_settled *s, at_memory m, at_real value)
{
    int64_t *known = &m.i[s->ints];
    at_real *stood = &m.r[s->reals];
    const int64_t now = m.i[AT_LAST];
    const int same =
        ((known[AT_HAS_CHANGED] != 0) && (at_minus(now, known[AT_CHANGED]) <= s->same_change)) ? 1 : 0;
    if ((known[AT_HAS_STOOD] == 0) || (same != 0)) {
        known[AT_HAS_STOOD] = 1;
        *stood = value;
    } else if (at_size(value - *stood) > s->change) {
        known[AT_HAS_CHANGED] = 1;
        known[AT_CHANGED] = now;
        known[AT_AWAITED] = 1;
        known[AT_HAS_LOW] = 0;
        *stood = value;
    } else {
        /* It stands. */
    }
}

static void at_run_settled(const at_plan *p, const at_settled *s, at_memory m)
{
    int64_t *known = &m.i[s->ints];
    const int64_t now = m.i[AT_LAST];
    const at_entry *loss = at_entry_of(p, s->loss, 0);
    int64_t stamp;
    const at_real set_point = at_port(p, m, s->set_point, 0, &stamp);
    at_real since = AT_R(0.0);
    if ((known[AT_HAS_NEWEST] != 0) && (at_minus(now, known[AT_NEWEST_LOSS]) > s->max_gap)) {
        known[AT_HAS_LOW] = 0;
    }
    if ((known[AT_HAS_CHANGED] != 0) && (known[AT_HAS_LOW] != 0) && (known[AT_AWAITED] != 0)
        && (at_minus(now, known[AT_LOW]) >= s->hold)) {
        known[AT_AWAITED] = 0;
        at_give(p, m, s->slot, at_seconds(at_minus(known[AT_LOW], known[AT_CHANGED])) / AT_R(60.0), now);
    }
    if (at_is_absent(set_point) == 0) {
        at_set_point(s, m, set_point);
    }
    if (at_ran(p, m, loss->slot) != 0) {
        const at_real value = at_read(p, m, loss, 0, &stamp);
        if (value < s->below) {
            if (known[AT_HAS_LOW] == 0) {
                known[AT_HAS_LOW] = 1;
                known[AT_LOW] = now;
            }
        } else {
            known[AT_HAS_LOW] = 0;
        }
        known[AT_HAS_NEWEST] = 1;
        known[AT_NEWEST_LOSS] = now;
    }
    if ((known[AT_HAS_CHANGED] != 0) && (known[AT_AWAITED] != 0)) {
        since = at_seconds(at_minus(now, known[AT_CHANGED])) / AT_R(60.0);
    }
    at_give(p, m, s->slot + 1, since, now);
}

/* ---- Channels passed on. */

static void at_run_pick(const at_plan *p, const at_pick *k, at_memory m)
{
    int32_t nth;
    for (nth = 0; nth < k->channels; nth++) {
        const at_entry *e = at_entry_of(p, k->gather, nth);
        if (at_ran(p, m, e->slot) != 0) {
            int64_t stamp;
            const at_real value = at_read(p, m, e, 0, &stamp);
            at_give(p, m, k->slot + nth, value, stamp);
        }
    }
}

/* ---- Sensors that are compared with each other. Of integers, of each channel: the stamp of the last sample that was looked at, since
 * when it contradicts the others, since when it is out and since when it agrees again, each behind whether it is known; whether its last
 * value passed, and whether a sample is new; behind all, when the last truth was known that was looked at, of how many windows, and of
 * which channel. Of numbers: the last value, its change, and the squares of what was sudden; behind all, those of errors with a sensor and
 * without. Within a step: the values, what of the form is left without the columns that are not there, the standardised columns, and what pulls at each. */

#define AT_HAS_LOOKED 0
#define AT_LOOKED 1
#define AT_CONTRADICTS 2
/* 3: since when. */
#define AT_IS_OUT 4
/* 5: since when. */
#define AT_AGREES 6
/* 7: since when. */
#define AT_PASSES 8
#define AT_IS_NEW 9
#define AT_OF_SENSOR 10
#define AT_READS 0
#define AT_CHANGE 1
#define AT_SUDDEN 2
#define AT_OF_READING 3
/* Behind those of all channels. */
#define AT_HAS_JUDGED 0
#define AT_JUDGED 1
#define AT_JUDGED_WINDOWS 2
#define AT_JUDGED_CHANNEL 3
#define AT_WITH 0
#define AT_WITHOUT 1

/* Whether something has lasted for so long; it begins now where it had not. */
static int at_lasts(int64_t since[], int64_t now, int64_t length)
{
    if (since[0] == 0) {
        since[0] = 1;
        since[1] = now;
    }
    return (at_minus(now, since[1]) >= length) ? 1 : 0;
}

/* Takes a column out of a symmetric form: it is then whatever makes the form smallest. */
static void at_free(at_real matrix[], int32_t columns, int32_t column)
{
    const at_real *own = &matrix[column * columns];
    int32_t row;
    int32_t nth;
    if (own[column] > AT_R(0.0)) {
        for (row = 0; row < columns; row++) {
            at_real *other = &matrix[row * columns];
            if (row != column) {
                const at_real along = other[column] / own[column];
                for (nth = 0; nth < columns; nth++) {
                    other[nth] = other[nth] - (along * own[nth]);
                }
            }
        }
        for (row = 0; row < columns; row++) {
            matrix[(row * columns) + column] = AT_R(0.0);
            matrix[(column * columns) + row] = AT_R(0.0);
        }
    }
}

/* How far values are apart. */
static at_real at_apart(const at_plan *p, const at_cross_check *c, at_memory m)
{
    const int32_t n = c->columns;
    const at_real *values = &m.r[p->scratch];
    at_real *matrix = &m.r[p->scratch + (2 * c->channels)];
    at_real *z = &matrix[n * n];
    at_real *pull = &z[n];
    const at_real *lower = c->matrix;
    at_real total = AT_R(-0.0);
    int32_t row;
    int32_t nth;
    for (row = 0; row < n; row++) {
        for (nth = 0; nth <= row; nth++) {
            matrix[(row * n) + nth] = lower[nth];
            matrix[(nth * n) + row] = lower[nth];
        }
        lower = &lower[row + 1];
    }
    for (nth = 0; nth < n; nth++) {
        z[nth] = at_over(values[c->places[nth]] - c->mean[nth], c->scale[nth]);
        if (at_is_absent(z[nth]) != 0) {
            z[nth] = AT_R(0.0);
            at_free(matrix, n, nth);
        }
    }
    for (row = 0; row < n; row++) {
        pull[row] = AT_R(-0.0);
        for (nth = 0; nth < n; nth++) {
            pull[row] = pull[row] + (matrix[(row * n) + nth] * z[nth]);
        }
    }
    for (nth = 0; nth < n; nth++) {
        total = total + (pull[nth] * z[nth]);
    }
    return at_over((total > AT_R(0.0)) ? total : AT_R(0.0), c->usual);
}

static at_real at_part(at_real pull, at_real own)
{
    return (own > AT_R(0.0)) ? ((pull * pull) / own) : AT_R(0.0);
}

/* How much of that one channel has in it. */
static at_real at_share(const at_plan *p, const at_cross_check *c, at_memory m, int32_t channel)
{
    const int32_t n = c->columns;
    const int32_t first = c->own[2 * channel];
    const int32_t second = c->own[(2 * channel) + 1];
    const at_real *matrix = &m.r[p->scratch + (2 * c->channels)];
    const at_real *pull = &matrix[(n * n) + n];
    at_real share = AT_R(0.0);
    if (first >= 0) {
        const at_real *own = &matrix[first * n];
        share = at_part(pull[first], own[first]);
        if (second >= 0) {
            const at_real along = (own[first] > AT_R(0.0)) ? (own[second] / own[first]) : AT_R(0.0);
            share = share
                + at_part(pull[second] - (along * pull[first]), matrix[(second * n) + second] - (along * own[second]));
        }
        share = at_over(share, c->usual);
    }
    return share;
}

/* The one that alone, and suddenly, makes values that are so far apart be so; -1 where there is none. */
static int32_t at_alone(const at_plan *p, const at_cross_check *c, at_memory m, at_real apart)
{
    const at_real *matrix = &m.r[p->scratch + (2 * c->channels)];
    at_real most = at_share(p, c, m, 0);
    int32_t suspect = 0;
    int32_t nth;
    for (nth = 1; nth < c->channels; nth++) {
        const at_real share = at_share(p, c, m, nth);
        if (share > most) {
            most = share;
            suspect = nth;
        }
    }
    nth = c->own[2 * suspect];
    if ((nth >= 0) && (apart > c->limit) && ((apart - most) <= c->limit)) {
        const at_real sudden = m.r[c->reals + (AT_OF_READING * suspect) + AT_SUDDEN];
        const at_real square = at_over(sudden, c->scale[nth] * c->scale[nth]);
        const at_real share = at_over(matrix[(nth * c->columns) + nth] * square, c->usual);
        if (!((AT_R(10.0) * share) >= most)) {
            suspect = -1;
        }
    } else {
        suspect = -1;
    }
    return suspect;
}

/* Takes the sensor that is out back, where it agrees again or has been out for long enough. */
static void at_take_back(const at_cross_check *c, at_memory m, int32_t out, int there, at_real apart)
{
    const int64_t now = m.i[AT_LAST];
    int64_t *sensor = &m.i[c->ints + (AT_OF_SENSOR * out)];
    int agrees = 0;
    if (there != 0) {
        if (apart > c->limit) {
            sensor[AT_AGREES] = 0;
        } else {
            agrees = at_lasts(&sensor[AT_AGREES], now, c->recover);
        }
    }
    if ((agrees != 0) || (at_lasts(&sensor[AT_IS_OUT], now, c->longest) != 0)) {
        sensor[AT_IS_OUT] = 0;
        sensor[AT_AGREES] = 0;
    }
}

/* Nothing is known from truths yet. */
static void at_begin_verdict(const at_cross_check *c, at_memory m)
{
    int64_t *verdict = &m.i[c->ints + (AT_OF_SENSOR * c->channels)];
    at_real *squares = &m.r[c->reals + (AT_OF_READING * c->channels)];
    verdict[AT_HAS_JUDGED] = 0;
    verdict[AT_JUDGED_WINDOWS] = 0;
    verdict[AT_JUDGED_CHANNEL] = -1;
    squares[AT_WITH] = AT_R(0.0);
    squares[AT_WITHOUT] = AT_R(0.0);
}

/* The truth as it was predicted at its run: from all columns, or without a channel. */
static at_real at_answer(const at_plan *p, const at_cross_check *c, at_memory m, int32_t nth)
{
    const at_real *own = &c->answers[nth * (c->predicting + 1)];
    at_real sum = own[0];
    int64_t stamp;
    int32_t column;
    for (column = 0; column < c->predicting; column++) {
        sum = sum + (own[column + 1] * at_port(p, m, c->before, c->places[column], &stamp));
    }
    return sum;
}

/* Looks at a truth of a run since a channel is out, one a window. */
static void at_know_better(const at_plan *p, const at_cross_check *c, at_memory m)
{
    int64_t *verdict = &m.i[c->ints + (AT_OF_SENSOR * c->channels)];
    at_real *squares = &m.r[c->reals + (AT_OF_READING * c->channels)];
    int64_t known;
    const at_real truth = at_port(p, m, c->later, 0, &known);
    int32_t out = 0;
    while ((out < c->channels) && (m.i[c->ints + (AT_OF_SENSOR * out) + AT_IS_OUT] == 0)) {
        out++;
    }
    if ((out < c->channels) && (at_is_absent(truth) == 0)
        && (at_minus(known, c->delay) >= m.i[c->ints + (AT_OF_SENSOR * out) + AT_IS_OUT + 1])
        && ((verdict[AT_HAS_JUDGED] == 0)
            || ((known > verdict[AT_JUDGED]) && (at_minus(known, verdict[AT_JUDGED]) >= c->span)))) {
        const at_real with = at_answer(p, c, m, 0) - truth;
        const at_real without = at_answer(p, c, m, out + 1) - truth;
        if ((at_is_absent(with) == 0) && (at_is_absent(without) == 0)) {
            verdict[AT_HAS_JUDGED] = 1;
            verdict[AT_JUDGED] = known;
            verdict[AT_JUDGED_WINDOWS]++;
            squares[AT_WITH] = (AT_R(0.9) * squares[AT_WITH]) + (with * with);
            squares[AT_WITHOUT] = (AT_R(0.9) * squares[AT_WITHOUT]) + (without * without);
        }
    }
}

/* Whether the sensor that is out is right by truths. */
static int at_believes(const at_cross_check *c, at_memory m)
{
    const int64_t windows = m.i[c->ints + (AT_OF_SENSOR * c->channels) + AT_JUDGED_WINDOWS];
    const at_real *squares = &m.r[c->reals + (AT_OF_READING * c->channels)];
    return ((windows >= 3) && (squares[AT_WITH] < squares[AT_WITHOUT])) ? 1 : 0;
}

/* Finds which sensor contradicts the others. */
static void at_compare(const at_plan *p, const at_cross_check *c, at_memory m)
{
    const int64_t now = m.i[AT_LAST];
    const at_real apart = at_apart(p, c, m);
    int64_t *verdict = &m.i[c->ints + (AT_OF_SENSOR * c->channels)];
    int32_t there = 0;
    int32_t out = -1;
    int32_t suspect = -1;
    int32_t nth;
    for (nth = 0; nth < c->channels; nth++) {
        there += (at_is_absent(m.r[p->scratch + nth]) == 0) ? 1 : 0;
        if ((out < 0) && (m.i[c->ints + (AT_OF_SENSOR * nth) + AT_IS_OUT] != 0)) {
            out = nth;
        }
    }
    if (out >= 0) {
        at_take_back(c, m, out, (at_is_absent(m.r[p->scratch + out]) == 0) ? 1 : 0, apart);
    } else {
        /* Half of all have to stay without it. */
        if ((2 * there) >= (c->channels + 2)) {
            suspect = at_alone(p, c, m, apart);
        }
        for (nth = 0; nth < c->channels; nth++) {
            int64_t *sensor = &m.i[c->ints + (AT_OF_SENSOR * nth)];
            if (suspect != nth) {
                sensor[AT_CONTRADICTS] = 0;
            } else if (at_lasts(&sensor[AT_CONTRADICTS], now, c->after) != 0) {
                sensor[AT_IS_OUT] = 1;
                sensor[AT_IS_OUT + 1] = now;
                sensor[AT_CONTRADICTS] = 0;
                if ((verdict[AT_JUDGED_CHANNEL] != nth)
                    || ((verdict[AT_HAS_JUDGED] != 0) && (at_minus(now, verdict[AT_JUDGED]) >= c->longest))) {
                    at_begin_verdict(c, m);
                    verdict[AT_JUDGED_CHANNEL] = nth;
                }
            } else {
                /* Not for long enough. */
            }
        }
    }
}

/* Takes what a sensor reads. */
static void at_take_reading(const at_cross_check *c, at_memory m, int32_t channel, at_real value, int64_t stamp)
{
    int64_t *sensor = &m.i[c->ints + (AT_OF_SENSOR * channel)];
    at_real *reading = &m.r[c->reals + (AT_OF_READING * channel)];
    sensor[AT_IS_NEW] =
        ((at_is_absent(value) == 0) && ((sensor[AT_HAS_LOOKED] == 0) || (sensor[AT_LOOKED] < stamp))) ? 1 : 0;
    if (sensor[AT_IS_NEW] != 0) {
        const int64_t gone = at_minus(stamp, sensor[AT_LOOKED]);
        if ((sensor[AT_HAS_LOOKED] != 0) && (gone <= c->lag)) {
            const at_real change = value - reading[AT_READS];
            const at_real jump = change - reading[AT_CHANGE];
            const at_real lag = at_seconds(c->lag);
            reading[AT_SUDDEN] = (reading[AT_SUDDEN] * (lag / (lag + at_seconds(gone)))) + (jump * jump);
            reading[AT_CHANGE] = change;
        } else {
            /* Over a hole heat may have moved it as far as it likes. */
            reading[AT_CHANGE] = AT_R(0.0);
            reading[AT_SUDDEN] = AT_R(0.0);
        }
        reading[AT_READS] = value;
        sensor[AT_HAS_LOOKED] = 1;
        sensor[AT_LOOKED] = stamp;
    }
}

static void at_run_cross_check(const at_plan *p, const at_cross_check *c, at_memory m)
{
    const int64_t now = m.i[AT_LAST];
    int64_t stamp;
    int32_t nth;
    int believes = 0;
    for (nth = 0; nth < (2 * c->channels); nth++) {
        m.r[p->scratch + nth] = at_port(p, m, c->signal, nth, &stamp);
        if (nth < c->channels) {
            at_take_reading(c, m, nth, m.r[p->scratch + nth], stamp);
        }
    }
    if (c->columns > 0) {
        at_compare(p, c, m);
    }
    if (AT_IS_USED(AT_HINDSIGHT) && (c->before >= 0)) {
        at_know_better(p, c, m);
        believes = at_believes(c, m);
    }
    for (nth = 0; nth < c->channels; nth++) {
        int64_t *sensor = &m.i[c->ints + (AT_OF_SENSOR * nth)];
        const at_real value = at_port(p, m, c->signal, nth, &stamp);
        const int passes = ((at_is_absent(value) == 0) && ((sensor[AT_IS_OUT] == 0) || (believes != 0))) ? 1 : 0;
        at_real reason = AT_R(0.0);
        if ((passes != 0) && (sensor[AT_IS_NEW] != 0)) {
            at_give(p, m, c->slot + nth, value, stamp);
        } else if ((passes == 0) && (sensor[AT_PASSES] != 0)) {
            at_give(p, m, c->slot + nth, AT_NAN, now);
        } else {
            /* As it was. */
        }
        sensor[AT_PASSES] = (int64_t)passes;
        if (c->columns == 0) {
            reason = AT_R(3.0);
        } else if (sensor[AT_IS_OUT] != 0) {
            reason = (sensor[AT_AGREES] != 0) ? AT_R(2.0) : AT_R(1.0);
            reason = (believes != 0) ? AT_R(4.0) : reason;
        } else {
            /* It agrees. */
        }
        at_give(p, m, c->slot + c->channels + nth, reason, now);
    }
}

/* ---- Samples at the instants of others. */

static void at_run_sample_at(const at_plan *p, const at_sample_at *s, at_memory m)
{
    int any = 0;
    int64_t stamp;
    int32_t nth;
    if ((at_gather_is(p, m, s->signal, AT_FRESH | AT_ENDED) == 0) && (at_gather_is(p, m, s->instants, AT_FRESH) == 0)) {
        return;
    }
    for (nth = 0; nth < p->gather[s->instants].count; nth++) {
        if (at_is_absent(at_port(p, m, s->instants, nth, &stamp)) == 0) {
            any = 1;
        }
    }
    for (nth = 0; (any != 0) && (nth < s->channels); nth++) {
        const at_real value = at_port(p, m, s->signal, nth, &stamp);
        at_give(p, m, s->slot + nth, value, stamp);
    }
}

/* ---- The health of sensors. Of integers, of each channel: when it was heard last, when its last sample within the range was, since when its
 * value is the same, when the first tick was, and since when it is in order again, each behind whether it is known; what is wrong with it;
 * where the next square goes, and whether there are enough. Of numbers: the last sample; squares of differences, and their sums as a tree, the
 * nth being that of the two at 2 n and 2 n + 1, with the squares behind the sums. */

#define AT_HEARD 0
#define AT_WITHIN 2
#define AT_SAME 4
#define AT_BEGUN 6
#define AT_IN_ORDER 8
#define AT_FAULT 10
#define AT_NEXT_SQUARE 11
#define AT_ENOUGH 12
#define AT_OF_HEALTH 13

#define AT_HEALTHY 0
#define AT_OF_RANGE 1
#define AT_OF_RATE 2
#define AT_STUCK 3
#define AT_QUIET 4
#define AT_NOISY 5
#define AT_SILENT 6
#define AT_RECOVERING 7

static int32_t at_numbers_of(const at_health *h)
{
    return 1 + (2 * h->kept);
}

/* Takes the square of a difference. */
static void at_note_square(const at_health *h, int64_t sensor[], at_real squares[], at_real difference)
{
    at_real *sums = &squares[h->kept];
    int32_t at = (int32_t)sensor[AT_NEXT_SQUARE];
    if (h->kept > 0) {
        squares[at] = difference * difference;
        at = (at + h->kept) / 2;
        while (at >= 1) {
            const int32_t left = 2 * at;
            const int32_t right = left + 1;
            sums[at] = ((left < h->kept) ? sums[left] : squares[left - h->kept])
                + ((right < h->kept) ? sums[right] : squares[right - h->kept]);
            at = at / 2;
        }
        sensor[AT_NEXT_SQUARE]++;
        if (sensor[AT_NEXT_SQUARE] == (int64_t)h->kept) {
            sensor[AT_NEXT_SQUARE] = 0;
            sensor[AT_ENOUGH] = 1;
        }
    }
}

/* What is wrong with a new sample. */
static int64_t at_examine(const at_health *h, int32_t channel, int64_t sensor[], at_real numbers[], at_real value,
                          int64_t now)
{
    const int had_heard = (sensor[AT_HEARD] != 0) ? 1 : 0;
    const int64_t silence = at_minus(now, sensor[AT_HEARD + 1]);
    int64_t found = AT_HEALTHY;
    sensor[AT_HEARD] = 1;
    sensor[AT_HEARD + 1] = now;
    if (!isfinite(value) || (value < h->lowest[channel]) || (value > h->highest[channel])) {
        return AT_OF_RANGE;
    }
    if (sensor[AT_WITHIN] != 0) {
        const at_real difference = value - numbers[0];
        const at_real passed = at_seconds(at_minus(now, sensor[AT_WITHIN + 1]));
        at_note_square(h, sensor, &numbers[1], difference);
        if ((difference != AT_R(0.0)) || ((had_heard != 0) && (h->pause >= 0) && (silence > h->pause))) {
            sensor[AT_SAME] = 1;
            sensor[AT_SAME + 1] = now;
        }
        if (at_size(difference) > (h->rate[channel] * passed)) {
            found = AT_OF_RATE;
        }
    }
    sensor[AT_WITHIN] = 1;
    sensor[AT_WITHIN + 1] = now;
    numbers[0] = value;
    if (found == AT_HEALTHY) {
        if ((at_lasts(&sensor[AT_SAME], now, h->stuck) != 0) && (h->stuck >= 0)) {
            found = AT_STUCK;
        } else if (sensor[AT_ENOUGH] != 0) {
            const at_real noise = at_root(AT_R(0.5) * (numbers[2 + h->kept] / (at_real)h->kept));
            if (noise < h->quiet[channel]) {
                found = AT_QUIET;
            } else if (noise > h->noisy[channel]) {
                found = AT_NOISY;
            } else {
                /* As it should be. */
            }
        } else {
            /* Too little is known. */
        }
    }
    return found;
}

/* Goes from what was found to what is given: a channel in order again is waited for. */
static void at_conclude(const at_health *h, int64_t sensor[], int64_t found, int64_t now)
{
    if (found != AT_HEALTHY) {
        sensor[AT_IN_ORDER] = 0;
        sensor[AT_FAULT] = found;
    } else if (sensor[AT_FAULT] != AT_HEALTHY) {
        if (at_lasts(&sensor[AT_IN_ORDER], now, h->recover) != 0) {
            sensor[AT_FAULT] = AT_HEALTHY;
            sensor[AT_IN_ORDER] = 0;
        } else {
            sensor[AT_FAULT] = AT_RECOVERING;
        }
    } else {
        /* It stays well. */
    }
}

static void at_run_health(const at_plan *p, const at_health *h, at_memory m)
{
    const int64_t now = m.i[AT_LAST];
    int32_t nth;
    for (nth = 0; nth < h->channels; nth++) {
        int64_t *sensor = &m.i[h->ints + (AT_OF_HEALTH * nth)];
        at_real *numbers = &m.r[h->reals + (at_numbers_of(h) * nth)];
        int64_t stamp;
        const at_real value = at_port(p, m, h->signal, nth, &stamp);
        if (sensor[AT_BEGUN] == 0) {
            sensor[AT_BEGUN] = 1;
            sensor[AT_BEGUN + 1] = now;
        }
        if (at_is_absent(value) == 0) {
            at_conclude(h, sensor, at_examine(h, nth, sensor, numbers, value, now), now);
            at_give(p, m, h->slot + nth, (sensor[AT_FAULT] == AT_HEALTHY) ? value : AT_NAN, stamp);
        } else {
            const int64_t heard = sensor[((sensor[AT_HEARD] != 0) ? AT_HEARD : AT_BEGUN) + 1];
            if ((h->gap >= 0) && (at_minus(now, heard) > h->gap) && (sensor[AT_FAULT] != AT_SILENT)) {
                at_conclude(h, sensor, AT_SILENT, now);
                at_give(p, m, h->slot + nth, AT_NAN, now);
            }
        }
        at_give(p, m, h->slot + h->channels + nth, (at_real)sensor[AT_FAULT], now);
    }
}

/* ---- Leaps: a position that is zeroed, homed or pushed. Of the integers of a series: whether there was a sample, and when; of the sample
 * before it and of that before the last leap, and before a change that may be one, the same; whether a change is known before the newest;
 * how many sizes there were of changes, of steps, of bends, and how many gaps; how many large steps. Of numbers: the last sample, the newest
 * change and that before, quantiles of the sizes and of gaps, and what large steps came to. */

#define AT_LAST_SAMPLE 0
#define AT_NEWEST_CHANGE 2
#define AT_LEAPT 4
#define AT_SUSPECTED 6
#define AT_BEFORE 8
#define AT_SIZES 9 /* what stands before does not outlast a segment */
#define AT_GAPS 12
#define AT_HOMED 13
#define AT_CHANGE 1
#define AT_CHANGE_BEFORE 2
#define AT_QUANTILES 3
#define AT_USUAL_GAP 9
#define AT_HOMES 10
#define AT_CHANGES 0
#define AT_STEPS 1
#define AT_BENDS 2

#define AT_FEWEST 20
#define AT_MOST_HOMES 8
#define AT_ALIKE AT_R(0.3)

/* A value that a share of what comes does not exceed, as it moves with the last hundreds. */
static at_real at_quantile(at_real was, at_real value, at_real share, int64_t nth)
{
    at_real is = value;
    at_real by = AT_R(4.0) / (at_real)nth;
    if (by < AT_R(0.05)) {
        by = AT_R(0.05);
    }
    if (nth > 1) {
        if (value > was) {
            is = was * (AT_R(1.0) + (by * share));
        } else {
            is = was / (AT_R(1.0) + (by * (AT_R(1.0) - share)));
        }
    }
    return is;
}

static void at_note_size(const at_course *c, at_memory m, int32_t of, at_real size)
{
    int64_t *seen = &m.i[c->ints + AT_SIZES + of];
    at_real *quantiles = &m.r[c->reals + AT_QUANTILES + (2 * of)];
    if ((size > AT_R(0.0)) && isfinite(size)) {
        (*seen)++;
        quantiles[0] = at_quantile(quantiles[0], size, AT_R(0.75), *seen);
        quantiles[1] = at_quantile(quantiles[1], size, AT_R(0.95), *seen);
    }
}

/* Changes that stand alone are leaps where they are larger. */
static at_real at_least_change(const at_course *c, at_memory m)
{
    const at_real *quantiles = &m.r[c->reals + AT_QUANTILES + (2 * AT_CHANGES)];
    const at_real spread = AT_R(10.0) * quantiles[0];
    const at_real usual = (quantiles[1] < spread) ? quantiles[1] : spread;
    return (m.i[c->ints + AT_SIZES + AT_CHANGES] < AT_FEWEST) ? (at_real)INFINITY : (AT_R(20.0) * usual);
}

/* Steps and bends are where they are larger than so many times what is usual. */
static at_real at_least_step(const at_course *c, at_memory m, int32_t of, at_real times)
{
    const at_real *quantiles = &m.r[c->reals + AT_QUANTILES + (2 * of)];
    const at_real part = AT_R(0.2) * quantiles[1];
    const at_real usual = (quantiles[0] > part) ? quantiles[0] : part;
    return (m.i[c->ints + AT_SIZES + of] < AT_FEWEST) ? (at_real)INFINITY : (times * usual);
}

/* Whether a change beside another leaves that one alone: it is small, or takes it back. */
static int at_stands_alone(at_real change, at_real beside)
{
    const at_real least = AT_R(0.1) * at_size(change);
    return ((at_size(beside) <= least) || (at_size(beside + change) <= least)) ? 1 : 0;
}

static int at_is_home(const at_course *c, at_memory m, at_real value)
{
    int32_t nth;
    int32_t count = 0;
    for (nth = 0; (nth < AT_MOST_HOMES) && ((int64_t)nth < m.i[c->ints + AT_HOMED]); nth++) {
        if (m.r[c->reals + AT_HOMES + nth] == value) {
            count++;
        }
    }
    return (count >= 2) ? 1 : 0;
}

/* Whether the newest change is a leap, now that the next one is known. */
static int at_was_leap(const at_course *c, at_memory m, at_real next)
{
    const at_real change = m.r[c->reals + AT_CHANGE];
    const at_real before = m.r[c->reals + AT_CHANGE_BEFORE];
    const at_real came_to = m.r[c->reals];
    const at_real least = at_least_step(c, m, AT_STEPS, AT_R(20.0));
    const at_real to_one = at_least_step(c, m, AT_STEPS, AT_R(8.0));
    const int has_before = (m.i[c->ints + AT_BEFORE] != 0) ? 1 : 0;
    int is_leap = ((at_stands_alone(change, next) != 0) && (at_size(change) > at_least_change(c, m)) &&
                   ((has_before == 0) || (at_stands_alone(change, before) != 0))) ? 1 : 0;
    if (has_before != 0) {
        const at_real size = at_size(change - ((before + next) / AT_R(2.0)));
        at_note_size(c, m, AT_STEPS, size);
        if ((at_size(next - before) <= (AT_ALIKE * size)) && (size > to_one)) {
            if ((size > least) || (at_is_home(c, m, came_to) != 0)) {
                is_leap = 1;
            }
            m.r[c->reals + AT_HOMES + (int32_t)(m.i[c->ints + AT_HOMED] % AT_MOST_HOMES)] = came_to;
            m.i[c->ints + AT_HOMED]++;
        }
    }
    return is_leap;
}

/* Whether the change to a value may be a leap, as far as those before it say. */
static int at_may_be_leap(const at_course *c, at_memory m, at_real value, at_real change, at_real least, const at_real steps[])
{
    const int has_before = (m.i[c->ints + AT_NEWEST_CHANGE] != 0) ? 1 : 0;
    const at_real before = m.r[c->reals + AT_CHANGE];
    const at_real bend = (has_before != 0) ? at_size(change - before) : AT_R(0.0);
    const at_real beside = bend / (AT_R(1.0) - (AT_ALIKE / AT_R(2.0)));
    int may_be = ((at_size(change) > least) && ((has_before == 0) || (at_stands_alone(change, before) != 0))) ? 1 : 0;
    if ((bend > at_least_step(c, m, AT_BENDS, AT_R(20.0))) && (beside > steps[0])) {
        may_be = 1;
    }
    if ((bend > at_least_step(c, m, AT_BENDS, AT_R(8.0))) && (beside > steps[1]) && (at_is_home(c, m, value) != 0)) {
        may_be = 1;
    }
    at_note_size(c, m, AT_BENDS, bend);
    return may_be;
}

/* Takes the next sample of a series that has one. */
static void at_take_change(const at_course *c, at_memory m, at_real value)
{
    int64_t *known = &m.i[c->ints];
    at_real *numbers = &m.r[c->reals];
    const int64_t since = known[AT_LAST_SAMPLE + 1];
    const at_real change = value - numbers[0];
    const at_real gap = at_seconds(at_minus(m.i[AT_LAST], since));
    const at_real least = at_least_change(c, m);
    const at_real steps[2] = { at_least_step(c, m, AT_STEPS, AT_R(20.0)), at_least_step(c, m, AT_STEPS, AT_R(8.0)) };
    int is_hole;
    if (known[AT_NEWEST_CHANGE] != 0) {
        if (at_was_leap(c, m, change) != 0) {
            known[AT_LEAPT] = 1;
            known[AT_LEAPT + 1] = known[AT_NEWEST_CHANGE + 1];
        }
        known[AT_SUSPECTED] = 0;
    }
    is_hole = ((known[AT_GAPS] >= AT_FEWEST) && (gap > (AT_R(3.0) * numbers[AT_USUAL_GAP]))) ? 1 : 0;
    known[AT_GAPS]++;
    numbers[AT_USUAL_GAP] = at_quantile(numbers[AT_USUAL_GAP], gap, AT_R(0.5), known[AT_GAPS]);
    if (is_hole != 0) {
        known[AT_BEFORE] = 0;
        known[AT_NEWEST_CHANGE] = 0;
    } else {
        known[AT_SUSPECTED] = (int64_t)at_may_be_leap(c, m, value, change, least, steps);
        known[AT_SUSPECTED + 1] = since;
        at_note_size(c, m, AT_CHANGES, at_size(change));
        known[AT_BEFORE] = known[AT_NEWEST_CHANGE];
        numbers[AT_CHANGE_BEFORE] = numbers[AT_CHANGE];
        known[AT_NEWEST_CHANGE] = 1;
        known[AT_NEWEST_CHANGE + 1] = since;
        numbers[AT_CHANGE] = change;
    }
}

/* Takes what is new of the series of a truth, and makes it absent where its window holds a leap. */
static void at_run_windowed(const at_plan *p, const at_windowed *w, at_memory m)
{
    const int64_t from = at_minus(at_stamp(p, m, w->slot), w->span);
    int leapt = 0;
    int32_t nth;
    for (nth = 0; nth < w->count; nth++) {
        const at_course *c = &w->courses[nth];
        int64_t *known = &m.i[c->ints];
        if ((at_is_fresh(p, m, c->slot) != 0) &&
            ((known[AT_LAST_SAMPLE] == 0) || (known[AT_LAST_SAMPLE + 1] < m.i[AT_LAST]))) {
            if (known[AT_LAST_SAMPLE] != 0) {
                at_take_change(c, m, at_value(p, m, c->slot));
            }
            known[AT_LAST_SAMPLE] = 1;
            known[AT_LAST_SAMPLE + 1] = m.i[AT_LAST];
            m.r[c->reals] = at_value(p, m, c->slot);
        }
        if (((known[AT_LEAPT] != 0) && (known[AT_LEAPT + 1] >= from)) ||
            ((known[AT_SUSPECTED] != 0) && (known[AT_SUSPECTED + 1] >= from))) {
            leapt = 1;
        }
    }
    if ((leapt != 0) && (at_ran(p, m, w->slot) != 0)) {
        m.r[p->slot_reals + w->slot] = AT_NAN;
    }
}

static void at_begin_windowed(const at_windowed *w, at_memory m)
{
    int32_t nth;
    int32_t place;
    for (nth = 0; nth < w->count; nth++) {
        for (place = 0; place < AT_SIZES; place++) {
            m.i[w->courses[nth].ints + place] = 0;
        }
    }
}

/* ---- The plan. */

static void at_run(const at_plan *p, at_memory m, const at_step *step)
{
    switch (step->kind) {
    case AT_GATHER:
        at_look(p, m, step->nth);
        break;
    case AT_SLOPE:
        if (AT_IS_USED(AT_SLOPE)) {
            at_run_slope(p, &p->slope[step->nth], m);
        }
        break;
    case AT_LAG:
        if (AT_IS_USED(AT_LAG)) {
            at_run_lag(p, &p->lag[step->nth], m);
        }
        break;
    case AT_FIRST_ORDER:
        if (AT_IS_USED(AT_FIRST_ORDER)) {
            at_run_first_order(p, &p->first_order[step->nth], m);
        }
        break;
    case AT_LINEAR:
        if (AT_IS_USED(AT_LINEAR)) {
            at_run_linear(p, &p->linear[step->nth], m);
        }
        break;
    case AT_VOTE:
        if (AT_IS_USED(AT_VOTE)) {
            at_run_vote(p, &p->vote[step->nth], m);
        }
        break;
    case AT_COMPENSATE:
        if (AT_IS_USED(AT_COMPENSATE)) {
            at_run_compensate(p, &p->compensate[step->nth], m);
        }
        break;
    case AT_STABILITY:
        if (AT_IS_USED(AT_STABILITY)) {
            at_run_stability(p, &p->stability[step->nth], m);
        }
        break;
    case AT_SAFE_STATE:
        if (AT_IS_USED(AT_SAFE_STATE)) {
            at_run_safe_state(p, &p->safe_state[step->nth], m);
        }
        break;
    case AT_UNCORRECTED:
        if (AT_IS_USED(AT_UNCORRECTED)) {
            at_run_uncorrected(p, &p->uncorrected[step->nth], m);
        }
        break;
    case AT_LOSS:
        if (AT_IS_USED(AT_LOSS)) {
            at_run_loss(p, &p->loss[step->nth], m);
        }
        break;
    case AT_SETTLED:
        if (AT_IS_USED(AT_SETTLED)) {
            at_run_settled(p, &p->settled[step->nth], m);
        }
        break;
    case AT_CROSS_CHECK:
        if (AT_IS_USED(AT_CROSS_CHECK)) {
            at_run_cross_check(p, &p->cross_check[step->nth], m);
        }
        break;
    case AT_SAMPLE_AT:
        if (AT_IS_USED(AT_SAMPLE_AT)) {
            at_run_sample_at(p, &p->sample_at[step->nth], m);
        }
        break;
    case AT_HEALTH:
        if (AT_IS_USED(AT_HEALTH)) {
            at_run_health(p, &p->health[step->nth], m);
        }
        break;
    case AT_WINDOWED:
        if (AT_IS_USED(AT_WINDOWED)) {
            at_run_windowed(p, &p->windowed[step->nth], m);
        }
        break;
    default:
        if (AT_IS_USED(AT_PICK)) {
            at_run_pick(p, &p->pick[step->nth], m);
        }
        break;
    }
}

/* Lets what a step keeps begin anew: at the start, or with a segment, in which what was learned stays. */
static void at_begin(const at_plan *p, at_memory m, const at_step *step, int segment)
{
    int32_t nth;
    switch (step->kind) {
    case AT_SLOPE:
        at_begin_slope(&p->slope[step->nth], m);
        break;
    case AT_FIRST_ORDER:
        for (nth = 0; nth < p->first_order[step->nth].channels; nth++) {
            m.i[p->first_order[step->nth].ints + nth] = 0;
        }
        break;
    case AT_VOTE:
        if (segment != 0) {
            at_segment_vote(p, &p->vote[step->nth], m);
        } else {
            at_begin_vote(p, &p->vote[step->nth], m);
        }
        break;
    case AT_COMPENSATE:
        at_begin_compensate(&p->compensate[step->nth], m);
        break;
    case AT_STABILITY:
        at_begin_stability(&p->stability[step->nth], m);
        break;
    case AT_SAFE_STATE:
        at_begin_safe_state(&p->safe_state[step->nth], m);
        break;
    case AT_UNCORRECTED:
        at_begin_uncorrected(&p->uncorrected[step->nth], m);
        break;
    case AT_SETTLED:
        for (nth = 0; nth <= AT_NEWEST_LOSS; nth++) {
            m.i[p->settled[step->nth].ints + nth] = 0;
        }
        break;
    case AT_CROSS_CHECK:
        for (nth = 0; nth < (AT_OF_SENSOR * p->cross_check[step->nth].channels); nth++) {
            m.i[p->cross_check[step->nth].ints + nth] = 0;
        }
        at_begin_verdict(&p->cross_check[step->nth], m);
        break;
    case AT_LINEAR:
        if (AT_IS_USED(AT_LEARNS) && (p->linear[step->nth].learner != NULL)) {
            at_begin_learner(p, &p->linear[step->nth], m, segment);
        }
        break;
    case AT_HEALTH:
        for (nth = 0; nth < (AT_OF_HEALTH * p->health[step->nth].channels); nth++) {
            m.i[p->health[step->nth].ints + nth] = 0;
        }
        break;
    case AT_WINDOWED:
        if (AT_IS_USED(AT_WINDOWED)) {
            at_begin_windowed(&p->windowed[step->nth], m);
        }
        break;
    default:
        /* It keeps nothing, or a history. */
        break;
    }
}

static void at_begin_all(const at_plan *plan, at_memory m, int segment)
{
    int32_t nth;
    for (nth = 0; nth < plan->steps; nth++) {
        at_begin(plan, m, &plan->step[nth], segment);
    }
    for (nth = 0; nth < plan->histories; nth++) {
        m.i[plan->history[nth].ints] = 0;
        m.i[plan->history[nth].ints + 1] = 0;
    }
    for (nth = 0; nth < plan->slots; nth++) {
        m.r[plan->slot_reals + nth] = AT_NAN;
        m.i[plan->slot_ints + nth] = INT64_MIN;
    }
}

void at_init(const at_plan *plan, at_memory m)
{
    int32_t nth;
    for (nth = 0; nth < plan->ints; nth++) {
        m.i[nth] = 0;
    }
    for (nth = 0; nth < plan->reals; nth++) {
        m.r[nth] = AT_R(0.0);
    }
    at_begin_all(plan, m, 0);
}

void at_segment(const at_plan *plan, at_memory m)
{
    if (m.i[AT_HAS_LAST] != 0) {
        at_begin_all(plan, m, 1);
        m.i[AT_HAS_BREAK] = 1;
        m.i[AT_BREAK] = m.i[AT_LAST];
        m.i[AT_HAS_LAST] = 0;
    }
}

uint32_t at_tick(const at_plan *plan, at_memory m, int64_t t_ns, const double in[], double out[])
{
    int32_t nth;
    const int is_back = ((m.i[AT_HAS_LAST] != 0) && (t_ns <= m.i[AT_LAST])) ? 1 : 0;
    if (((is_back != 0) && (m.i[AT_LOADED] == 0)) || (t_ns == INT64_MIN)) {
        m.i[AT_REFUSED_COUNT]++;
        for (nth = 0; nth < plan->outputs; nth++) {
            out[nth] = (double)NAN;
        }
        return AT_REFUSED;
    }
    if (is_back != 0) {
        at_segment(plan, m);
    }
    for (nth = 0; AT_IS_USED(AT_FAST) && (m.i[AT_LOADED] != 0) && (nth < plan->steps); nth++) {
        if ((plan->step[nth].kind == AT_SLOPE) && (plan->slope[plan->step[nth].nth].kept >= 0)) {
            at_rebuild(plan, &plan->slope[plan->step[nth].nth], m);
        }
    }
    m.i[AT_LOADED] = 0;
    if (m.i[AT_HAS_BREAK] != 0) {
        const int64_t shift = at_minus(t_ns, m.i[AT_BREAK]);
        m.i[AT_HAS_BREAK] = 0;
        for (nth = 0; nth < plan->steps; nth++) {
            if (plan->step[nth].kind == AT_VOTE) {
                at_shift_vote(plan, &plan->vote[plan->step[nth].nth], m, shift);
            } else if (AT_IS_USED(AT_LEARNS) && (plan->step[nth].kind == AT_LINEAR) &&
                       (plan->linear[plan->step[nth].nth].learner != NULL)) {
                at_shift_learner(&plan->linear[plan->step[nth].nth], m, shift);
            } else {
                /* Nothing else waits for truths. */
            }
        }
    }
    m.i[AT_HAS_LAST] = 1;
    m.i[AT_LAST] = t_ns;
    m.i[AT_TICK]++;
    m.i[AT_FLAGS] = (is_back != 0) ? (int64_t)AT_RESTARTED : 0;
    for (nth = 0; nth < plan->sources; nth++) {
        const at_real sample = (at_real)in[nth];
        if (isfinite(sample) && (sample >= plan->lowest[nth]) && (sample <= plan->highest[nth])) {
            at_put(plan, m, nth, sample, t_ns);
        } else if (at_is_absent(sample) == 0) {
            m.i[plan->rejected_ints + nth]++;
            m.i[AT_FLAGS] |= (int64_t)AT_REJECTED;
        } else {
            /* No new value. */
        }
    }
    for (nth = 0; nth < plan->steps; nth++) {
        at_run(plan, m, &plan->step[nth]);
    }
    for (nth = 0; nth < plan->recorded; nth++) {
        const at_history *h = &plan->history[nth];
        if (at_ran(plan, m, h->slot) != 0) {
            at_write(h, m, t_ns, at_value(plan, m, h->slot), at_stamp(plan, m, h->slot));
        }
    }
    for (nth = 0; nth < plan->steps; nth++) {
        if (plan->step[nth].kind == AT_VOTE) {
            const at_vote *v = &plan->vote[plan->step[nth].nth];
            if ((v->truth >= 0) && (at_is_fresh(plan, m, v->truth) != 0)) {
                at_take_truth(plan, v, m);
            }
        } else if (AT_IS_USED(AT_LEARNS) && (plan->step[nth].kind == AT_LINEAR)) {
            const at_linear *l = &plan->linear[plan->step[nth].nth];
            if ((l->learner != NULL) && (at_is_fresh(plan, m, l->learner->truth) != 0)) {
                at_note_truth(plan, l, m);
            }
        } else {
            /* It takes no truths. */
        }
    }
    for (nth = 0; nth < plan->outputs; nth++) {
        const int32_t slot = plan->output[nth];
        out[nth] = (at_ran(plan, m, slot) != 0) ? (double)at_value(plan, m, slot) : (double)NAN;
    }
    return (uint32_t)m.i[AT_FLAGS];
}

/* ---- Saved states: a name, the revision, how much there is, the integers, the numbers as those of double precision, a checksum. */

#define AT_HEADER 5
#define AT_NAME UINT64_C(0x3220432068746120) /* " ath C 2" */

static void at_put_word(uint8_t bytes[], size_t nth, uint64_t word)
{
    size_t byte;
    for (byte = 0; byte < 8u; byte++) {
        bytes[(8u * nth) + byte] = (uint8_t)((word >> (8u * byte)) & UINT64_C(0xff));
    }
}

static uint64_t at_get_word(const uint8_t bytes[], size_t nth)
{
    uint64_t word = 0;
    size_t byte;
    for (byte = 0; byte < 8u; byte++) {
        word |= ((uint64_t)bytes[(8u * nth) + byte]) << (8u * byte);
    }
    return word;
}

static uint64_t at_checksum(const uint8_t bytes[], size_t words)
{
    uint64_t hash = AT_HASH_BEGIN;
    size_t nth;
    for (nth = 0; nth < words; nth++) {
        hash = at_hash(hash, at_get_word(bytes, nth));
    }
    return hash;
}

static size_t at_words(const at_plan *plan)
{
    return ((size_t)AT_HEADER + (size_t)plan->ints) + (size_t)plan->saved;
}

size_t at_saved_size(const at_plan *plan)
{
    return 8u * (at_words(plan) + 1u);
}

size_t at_save(const at_plan *plan, const int64_t ints[], const at_real reals[], uint8_t bytes[], size_t room)
{
    const size_t count = (size_t)plan->ints;
    size_t written = 0;
    size_t nth;
    if (room >= at_saved_size(plan)) {
        at_put_word(bytes, 0, AT_NAME);
        at_put_word(bytes, 1, plan->revision);
        at_put_word(bytes, 2, (uint64_t)plan->ints);
        at_put_word(bytes, 3, (uint64_t)plan->saved);
        at_put_word(bytes, 4, (uint64_t)sizeof(at_real));
        for (nth = 0; nth < count; nth++) {
            at_put_word(bytes, (size_t)AT_HEADER + nth, (nth == (size_t)AT_LOADED) ? 0u : (uint64_t)ints[nth]);
        }
        for (nth = 0; nth < (size_t)plan->saved; nth++) {
            at_put_word(bytes, ((size_t)AT_HEADER + count) + nth, at_bits((double)reals[nth]));
        }
        at_put_word(bytes, at_words(plan), at_checksum(bytes, at_words(plan)));
        written = at_saved_size(plan);
    }
    return written;
}

int at_load(const at_plan *plan, at_memory m, const uint8_t bytes[], size_t length)
{
    const size_t ints = (size_t)plan->ints;
    size_t nth;
    if ((length != at_saved_size(plan)) || (at_get_word(bytes, 0) != AT_NAME)
        || (at_get_word(bytes, 1) != plan->revision) || (at_get_word(bytes, 2) != (uint64_t)plan->ints)
        || (at_get_word(bytes, 3) != (uint64_t)plan->saved) || (at_get_word(bytes, 4) != (uint64_t)sizeof(at_real))
        || (at_get_word(bytes, at_words(plan)) != at_checksum(bytes, at_words(plan)))) {
        return 1;
    }
    for (nth = 0; nth < ints; nth++) {
        const uint64_t word = at_get_word(bytes, (size_t)AT_HEADER + nth);
        m.i[nth] = (word <= (uint64_t)INT64_MAX) ? (int64_t)word : (-(int64_t)(UINT64_MAX - word) - 1);
    }
    for (nth = 0; nth < (size_t)plan->saved; nth++) {
        m.r[nth] = (at_real)at_number(at_get_word(bytes, ((size_t)AT_HEADER + ints) + nth));
    }
    m.i[AT_LOADED] = 1;
    return 0;
}
