/* The runtime of exported graphs; see athermal_rt.h. */
#include "athermal_rt.h"

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
    const double q1 = -3.33333333333331316428e-02;
    const double q2 = 1.58730158725481460165e-03;
    const double q3 = -7.93650757867487942473e-05;
    const double q4 = 4.00821782732936239552e-06;
    const double q5 = -2.01099218183624371326e-07;
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
    r1 = 1.0 + (square * (q1 + (square * (q2 + (square * (q3 + (square * (q4 + (square * q5)))))))));
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

static void at_close_block(const at_slope *s, at_memory m, int64_t now)
{
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
    }
}

static void at_push(const at_plan *p, const at_slope *s, at_memory m)
{
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
        at_close_block(s, m, now);
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
    }
    for (window = 0; window < s->windows; window++) {
        at_advance(s, m, window, now);
    }
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
    mean_t = mean_t / n;
    mean_y = mean_y / n;
    for (row = head; row < rows; row++) {
        const at_real y = (at_row(s, m, row)[channel] - origin) - mean_y;
        if (at_is_absent(y) == 0) {
            const at_real t = (at_real)at_minus(at_row_time(s, m, row), begin) - mean_t;
            sxx = sxx + (t * t);
            sxy = sxy + (t * y);
        }
    }
    return (sxy / sxx) * AT_R(1.0e9);
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
            scale = AT_R(1.0e9) / ((n * tt) - (t * t));
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
    int32_t nth = 0;
    if (at_gather_is(p, m, s->gather, AT_FRESH) == 0) {
        return;
    }
    at_push(p, s, m);
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

static at_real at_form(const at_linear *l, const at_real row[])
{
    at_real sums[4] = { AT_R(0.0), AT_R(0.0), AT_R(0.0), AT_R(0.0) };
    at_real others = AT_R(-0.0);
    int32_t nth = 0;
    while ((nth + 4) <= l->width) {
        sums[0] = sums[0] + (l->coefficients[nth] * row[nth]);
        sums[1] = sums[1] + (l->coefficients[nth + 1] * row[nth + 1]);
        sums[2] = sums[2] + (l->coefficients[nth + 2] * row[nth + 2]);
        sums[3] = sums[3] + (l->coefficients[nth + 3] * row[nth + 3]);
        nth += 4;
    }
    while (nth < l->width) {
        others = others + (l->coefficients[nth] * row[nth]);
        nth++;
    }
    return l->constant + (((sums[0] + sums[2]) + (sums[1] + sums[3])) + others);
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
    return at_unless_infinite(at_root(beyond / ((size + (at_real)width) * n->edge)));
}

static void at_run_linear(const at_plan *p, const at_linear *l, at_memory m)
{
    const int64_t now = m.i[AT_LAST];
    at_real *row = &m.r[p->scratch];
    at_real value = AT_NAN;
    at_real novelty = AT_NAN;
    int64_t oldest = (l->width == 0) ? now : INT64_MAX;
    int whole = 1;
    int32_t nth;
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
    if ((whole != 0) && (oldest < INT64_MAX)) {
        value = (l->same != 0) ? row[0] : at_form(l, row);
        if (l->novelty != NULL) {
            novelty = at_novelty_of(l->novelty, row, l->width, &row[l->width]);
            if (novelty > AT_R(1.0)) {
                if (l->outside == AT_SHRINK) {
                    value = l->centre + ((value - l->centre) / novelty);
                } else if (l->outside == AT_GONE) {
                    value = AT_NAN;
                } else {
                    /* It passes. */
                }
            }
        }
    }
    if (!isfinite(value)) {
        value = AT_NAN;
        oldest = now;
    }
    at_put(p, m, l->slot, value, oldest);
    if (l->novelty_slot >= 0) {
        at_put(p, m, l->novelty_slot, novelty, oldest);
    }
}

/* ---- Votes. Of integers: how many runs there were and the number of the first that counts; where the oldest waiting truth lies and
 * how many wait; the state that is followed, another one and since when; times of runs; of waiting truths the arrival and the run; of
 * each voter where its oldest error lies and how many there are; arrivals of errors. Of numbers: rows of runs, waiting truths, squares of
 * errors; of each voter the sum and the mean of these, and what it counts by its novelty. */

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
    b.error_times = &b.rings[2 * b.judged];
    b.rows = &m.r[v->reals];
    b.truths = &b.rows[v->runs * b.voters];
    b.squares = &b.truths[v->waiting];
    b.sums = &b.squares[b.judged * v->errors];
    b.means = &b.sums[b.judged];
    b.trust = &b.means[b.judged];
    b.votes = &m.r[p->scratch];
    b.weights = &b.votes[b.voters];
    return b;
}

static int32_t at_error_place(const at_vote *v, const at_ballot *b, int32_t voter, int64_t nth)
{
    int64_t place = b->rings[2 * voter] + nth;
    if (place >= (int64_t)v->errors) {
        place -= (int64_t)v->errors;
    }
    return (voter * v->errors) + (int32_t)place;
}

static void at_forget_error(const at_vote *v, const at_ballot *b, int32_t voter)
{
    b->rings[2 * voter] = (b->rings[2 * voter] + 1) % (int64_t)v->errors;
    b->rings[(2 * voter) + 1]--;
}

/* Takes the mean of what is in memory afresh. */
static void at_refresh(const at_vote *v, const at_ballot *b, int32_t voter)
{
    const int64_t count = b->rings[(2 * voter) + 1];
    at_real sum = AT_R(0.0);
    int64_t nth;
    for (nth = 0; nth < count; nth++) {
        sum = sum + b->squares[at_error_place(v, b, voter, nth)];
    }
    b->sums[voter] = sum;
    b->means[voter] = (count > 0) ? (sum / (at_real)count) : AT_NAN;
}

static void at_observe_one(const at_vote *v, const at_ballot *b, at_memory m, int32_t voter, at_real vote,
                           at_real truth, int64_t arrived)
{
    const int64_t count = b->rings[(2 * voter) + 1];
    at_real square = (vote - truth) * (vote - truth);
    int afresh = 0;
    int32_t place;
    if (!((truth * truth) <= AT_LARGEST) || (at_is_absent(square) != 0)) {
        return;
    }
    if (square > AT_LARGEST) {
        square = AT_LARGEST;
    }
    if ((v->memory == AT_BY_COUNT) && (count >= v->longest)) {
        at_forget_error(v, b, voter);
        afresh = 1;
    } else if (count >= (int64_t)v->errors) {
        at_forget_error(v, b, voter);
        m.i[AT_FLAGS] |= (int64_t)AT_FULL;
        afresh = 1;
    } else {
        /* There is room. */
    }
    place = at_error_place(v, b, voter, b->rings[(2 * voter) + 1]);
    b->error_times[place] = arrived;
    b->squares[place] = square;
    b->rings[(2 * voter) + 1]++;
    if (afresh != 0) {
        at_refresh(v, b, voter);
    } else {
        b->sums[voter] = b->sums[voter] + square;
        b->means[voter] = b->sums[voter] / (at_real)b->rings[(2 * voter) + 1];
    }
}

static int at_keeps_errors(const at_vote *v)
{
    return ((v->rule == AT_AUTO_WEIGHTED) || (v->rule == AT_BEST) || (v->rule == AT_GUARD)) ? 1 : 0;
}

/* Hands over every truth that arrived up to `newest`. */
static void at_hand_over(const at_vote *v, const at_ballot *b, at_memory m, int64_t newest)
{
    while (m.i[v->ints + AT_WAITING] > 0) {
        const int32_t place = (int32_t)m.i[v->ints + AT_WAITING_FROM];
        const int64_t run = b->run_of[place];
        const int64_t kept = m.i[v->ints + AT_RUNS] - run;
        int32_t voter;
        if (b->arrived[place] > newest) {
            break;
        }
        m.i[v->ints + AT_WAITING_FROM] = ((int64_t)place + 1) % (int64_t)v->waiting;
        m.i[v->ints + AT_WAITING]--;
        if (kept > (int64_t)v->runs) {
            m.i[AT_FLAGS] |= (int64_t)AT_FULL;
            continue;
        }
        for (voter = 0; (voter < b->voters) && (at_keeps_errors(v) != 0); voter++) {
            const at_real vote = b->rows[((int32_t)(run % (int64_t)v->runs) * b->voters) + voter];
            if (at_is_absent(vote) == 0) {
                at_observe_one(v, b, m, voter, vote, b->truths[place], b->arrived[place]);
                if (v->rule == AT_GUARD) {
                    at_observe_one(v, b, m, b->voters + voter, AT_R(0.0), b->truths[place], b->arrived[place]);
                }
            }
        }
    }
}

static void at_forget_errors(const at_vote *v, const at_ballot *b, int64_t newest)
{
    const int64_t forgotten = at_minus(newest, v->longest);
    int32_t voter;
    for (voter = 0; voter < b->judged; voter++) {
        int any = 0;
        while ((b->rings[(2 * voter) + 1] > 0)
               && (b->error_times[at_error_place(v, b, voter, 0)] <= forgotten)) {
            at_forget_error(v, b, voter);
            any = 1;
        }
        if (any != 0) {
            at_refresh(v, b, voter);
        }
    }
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
        scale = (AT_R(1.0) - below) / above;
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
    if ((v->form == AT_INVERSE_POWER) || (v->form == AT_INVERSE_FOURTH_POWER)) {
        const at_real ratio = best / ((mean > AT_SMALLEST) ? mean : AT_SMALLEST);
        weight = (v->form == AT_INVERSE_POWER) ? ratio : (ratio * ratio);
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
        total = AT_R(-0.0);
        for (voter = 0; voter < b->voters; voter++) {
            if (at_is_absent(b->votes[voter]) == 0) {
                b->weights[voter] = b->weights[voter] * b->trust[voter];
                total = total + b->weights[voter];
            }
        }
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
            b->weights[voter] = b->weights[voter] / total;
            any = 1;
        }
    }
    return ((any != 0) && (total != AT_R(0.0))) ? (sum / total) : AT_NAN;
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
    return sum / (at_real)(count - (2 * away));
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
                (at_is_absent(b->means[voter]) != 0) ? (at_real)INFINITY : (b->means[voter] / trust);
            if ((chosen < 0) || (error < least)) {
                chosen = voter;
                least = error;
            }
        }
    }
    return chosen;
}

static at_real at_judge(const at_vote *v, const at_ballot *b)
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
                && ((at_real)b->rings[(2 * zero) + 1] >= v->min_truths)) {
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

static at_real at_guard(const at_vote *v, const at_ballot *b, at_real *reason)
{
    const int32_t count = at_present(b);
    const at_real judged = at_judge(v, b);
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
        value = at_guard(v, b, reason);
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
        if ((at_keeps_errors(v) != 0) && (v->memory == AT_BY_TIME)) {
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
        at_give(p, m, v->novelty_slot, sum / known, stamp);
    }
}

/* Takes a truth that has just been measured, now that all outputs are there. */
static void at_take_truth(const at_plan *p, const at_vote *v, at_memory m)
{
    const at_ballot b = at_ballot_of(p, v, m);
    const int64_t now = m.i[AT_LAST];
    const int64_t due = at_minus(now, v->ahead);
    const int64_t runs = m.i[v->ints + AT_RUNS];
    int64_t low = m.i[v->ints + AT_FIRST_RUN];
    int64_t high = runs;
    if ((runs - low) > (int64_t)v->runs) {
        low = runs - (int64_t)v->runs;
    }
    {
        const int64_t oldest = low;
        while (low < high) {
            const int64_t middle = low + ((high - low) / 2);
            if (b.run_times[middle % (int64_t)v->runs] <= due) {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        if (low == oldest) {
            if (oldest > m.i[v->ints + AT_FIRST_RUN]) {
                m.i[AT_FLAGS] |= (int64_t)AT_FULL;
            }
            return;
        }
    }
    if (at_minus(due, b.run_times[(low - 1) % (int64_t)v->runs]) <= v->limit) {
        int32_t place;
        if (m.i[v->ints + AT_WAITING] >= (int64_t)v->waiting) {
            m.i[v->ints + AT_WAITING_FROM] = (m.i[v->ints + AT_WAITING_FROM] + 1) % (int64_t)v->waiting;
            m.i[v->ints + AT_WAITING]--;
            m.i[AT_FLAGS] |= (int64_t)AT_FULL;
        }
        place = (int32_t)((m.i[v->ints + AT_WAITING_FROM] + m.i[v->ints + AT_WAITING]) % (int64_t)v->waiting);
        b.arrived[place] = now;
        b.run_of[place] = low - 1;
        b.truths[place] = at_value(p, m, v->truth);
        m.i[v->ints + AT_WAITING]++;
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
    int32_t voter;
    m.i[v->ints + AT_FOLLOWED] = -1;
    m.i[v->ints + AT_OTHER] = -1;
    for (voter = 0; (voter < b.judged) && (at_keeps_errors(v) != 0); voter++) {
        int64_t nth;
        for (nth = 0; nth < b.rings[(2 * voter) + 1]; nth++) {
            int64_t *arrived = &b.error_times[at_error_place(v, &b, voter, nth)];
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

/* ---- The plan. */

static void at_run(const at_plan *p, at_memory m, const at_step *step)
{
    switch (step->kind) {
    case AT_GATHER:
        at_look(p, m, step->nth);
        break;
    case AT_SLOPE:
        at_run_slope(p, &p->slope[step->nth], m);
        break;
    case AT_LAG:
        at_run_lag(p, &p->lag[step->nth], m);
        break;
    case AT_FIRST_ORDER:
        at_run_first_order(p, &p->first_order[step->nth], m);
        break;
    case AT_LINEAR:
        at_run_linear(p, &p->linear[step->nth], m);
        break;
    case AT_VOTE:
        at_run_vote(p, &p->vote[step->nth], m);
        break;
    case AT_COMPENSATE:
        at_run_compensate(p, &p->compensate[step->nth], m);
        break;
    case AT_STABILITY:
        at_run_stability(p, &p->stability[step->nth], m);
        break;
    case AT_SAFE_STATE:
        at_run_safe_state(p, &p->safe_state[step->nth], m);
        break;
    case AT_UNCORRECTED:
        at_run_uncorrected(p, &p->uncorrected[step->nth], m);
        break;
    case AT_LOSS:
        at_run_loss(p, &p->loss[step->nth], m);
        break;
    case AT_SETTLED:
        at_run_settled(p, &p->settled[step->nth], m);
        break;
    default:
        at_run_pick(p, &p->pick[step->nth], m);
        break;
    }
}

/* Lets what a step keeps begin anew: at the start, or with a segment, in which votes keep what they have learned. */
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
    if (((m.i[AT_HAS_LAST] != 0) && (t_ns <= m.i[AT_LAST])) || (t_ns == INT64_MIN)) {
        m.i[AT_REFUSED_COUNT]++;
        return AT_REFUSED;
    }
    if (m.i[AT_HAS_BREAK] != 0) {
        const int64_t shift = at_minus(t_ns, m.i[AT_BREAK]);
        m.i[AT_HAS_BREAK] = 0;
        for (nth = 0; nth < plan->steps; nth++) {
            if (plan->step[nth].kind == AT_VOTE) {
                at_shift_vote(plan, &plan->vote[plan->step[nth].nth], m, shift);
            }
        }
    }
    m.i[AT_HAS_LAST] = 1;
    m.i[AT_LAST] = t_ns;
    m.i[AT_TICK]++;
    m.i[AT_FLAGS] = 0;
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
#define AT_NAME UINT64_C(0x3120432068746120) /* " ath C 1" */

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
    return ((size_t)AT_HEADER + (size_t)plan->ints) + (size_t)plan->reals;
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
        at_put_word(bytes, 3, (uint64_t)plan->reals);
        at_put_word(bytes, 4, (uint64_t)sizeof(at_real));
        for (nth = 0; nth < count; nth++) {
            at_put_word(bytes, (size_t)AT_HEADER + nth, (uint64_t)ints[nth]);
        }
        for (nth = 0; nth < (size_t)plan->reals; nth++) {
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
        || (at_get_word(bytes, 3) != (uint64_t)plan->reals) || (at_get_word(bytes, 4) != (uint64_t)sizeof(at_real))
        || (at_get_word(bytes, at_words(plan)) != at_checksum(bytes, at_words(plan)))) {
        return 1;
    }
    for (nth = 0; nth < ints; nth++) {
        const uint64_t word = at_get_word(bytes, (size_t)AT_HEADER + nth);
        m.i[nth] = (word <= (uint64_t)INT64_MAX) ? (int64_t)word : (-(int64_t)(UINT64_MAX - word) - 1);
    }
    for (nth = 0; nth < (size_t)plan->reals; nth++) {
        m.r[nth] = (at_real)at_number(at_get_word(bytes, ((size_t)AT_HEADER + ints) + nth));
    }
    return 0;
}
