/* The runtime of exported graphs: C99, no allocation, no recursion, state of fixed size. Of the C library it uses math.h alone.
 *
 * A plan is constant data that `athermal export c` writes. Its state is two arrays, of integers and of numbers, which the generated
 * header declares. Absence is NaN. Times are nanoseconds. All sums are taken in the order in which the engine takes them, so that
 * results are the same to the bit, as long as the compiler neither fuses products with sums nor computes wider than double:
 * build with -std=c99 -ffp-contract=off, and let the self test of the plan say whether it did. */
#ifndef ATHERMAL_RT_H
#define ATHERMAL_RT_H

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#if !defined(FLT_EVAL_METHOD) || (FLT_EVAL_METHOD != 0)
#error "numbers must be computed in their own precision: FLT_EVAL_METHOD must be 0 (gcc on x86: -msse2 -mfpmath=sse)"
#endif
#if defined(__FINITE_MATH_ONLY__) && (__FINITE_MATH_ONLY__ != 0)
#error "absence is NaN: build without -ffast-math, -Ofast and -ffinite-math-only"
#endif

#ifdef ATHERMAL_FLOAT
/* Single precision: for small processors, within the error that the self test prints. */
typedef float at_real;
#define AT_LIMIT 1.0e15f
#define AT_SMALLEST FLT_MIN
#define AT_LARGEST 1.0e35f
#else
typedef double at_real;
#define AT_LIMIT 1.0e100
#define AT_SMALLEST DBL_MIN
#define AT_LARGEST 1.0e290
#endif

/* A constant in the precision of the runtime. */
#define AT_R(x) ((at_real)(x))

/* What a step says; 0 is well. */
#define AT_REFUSED 1u /* the time is not after the last one: nothing has changed, and there are no outputs */
#define AT_FULL 2u    /* ticks came faster than the plan has room for: the oldest were forgotten, results are no longer the engine's */
#define AT_REJECTED 4u /* a sample was infinite or out of its range, and counts as absent */
#define AT_RESTARTED 8u /* the clock began anew since the state was loaded: this tick begins another segment */

/* A value that is read: which slot, how far back, and how old it may be; the history of the slot, -1 where it is read as it is now. */
typedef struct {
    int32_t slot;
    int32_t history;
    int64_t lag;
    int64_t max_age;
    at_real factor; /* into the unit of the reader; 1 where it is the same */
    int64_t spared; /* until which age it does not age what is made of it; -1 of what always does */
} at_entry;

/* Values that are read together; `held` ones count until they are too old, others only at their own tick. */
typedef struct {
    int32_t first;
    int32_t count;
    int32_t held;
} at_gather;

/* The past of a slot: a ring of `room` values from number `reals` on, their instants and, where `stamped`, stamps from `ints` on. */
typedef struct {
    int32_t slot;
    int32_t room;
    int32_t ints;
    int32_t reals;
    int32_t stamped;
    int64_t depth;
} at_history;

typedef struct {
    int32_t gather;
    int32_t slot;
    int32_t channels;
    int32_t windows;
    const int64_t *width;
    const int64_t *needed_span;
    const int64_t *needed_open;
    const int32_t *order; /* of the windows, the shortest first */
    const at_real *factors;
    int64_t min_samples;
    int32_t room;
    int32_t blocks;
    int32_t ints;
    int32_t reals;
    int32_t kept; /* where sums are kept, so that a tick does not sum all rows anew; -1 */
} at_slope;

typedef struct {
    int32_t gather;
    int32_t slot;
    int32_t channels;
    int32_t lags;
    const int64_t *lag;
    const int64_t *max_age;
    int32_t first_history;
} at_lag;

typedef struct {
    int32_t gather;
    int32_t slot;
    int32_t channels;
    int32_t bank;
    const at_real *rates;
    int32_t difference;
    int32_t ints;
    int32_t reals;
} at_first_order;

/* How far a row of regressors lies outside of those of the fit. */
typedef struct {
    int32_t directions;
    at_real edge;
    const at_real *mean;
    const at_real *inverse;
    const at_real *along; /* by regressor: its part in each direction */
} at_novelty;

#define AT_PASS 0
#define AT_SHRINK 1
#define AT_GONE 2

/* The variance of truths about what a fit predicts. */
typedef struct {
    at_real noise;
    at_real least; /* what the mean brings */
    const at_real *centre;
    const at_real *root; /* a lower triangle row by row */
} at_variance;

/* How sure a recursion is of its coefficients, on regressors that are standardised so. */
typedef struct {
    at_real variance; /* of what is left */
    const at_real *mean;
    const at_real *scale;
    const at_real *root; /* W of their covariance W'W as the fit left it, the constant last: a lower triangle row by row */
} at_spread;

/* Goes on learning: recursive least squares. Learners that read the same have one place for their past rows. */
typedef struct {
    int32_t freeze; /* the gather of channels that must all be 0; -1 */
    int32_t truth;  /* the slot of the truth */
    int64_t ahead;
    int64_t limit;
    int64_t embargo;
    int32_t runs; /* room for so many rows and truths that wait */
    int32_t waiting;
    int32_t run_ints;
    int32_t run_reals;
    at_real below; /* the sizes of truths that are learned from */
    at_real above;
    const at_real *lowest; /* where regressors are */
    const at_real *highest;
    at_real outliers;
    int64_t window;  /* that a truth tells of */
    int64_t between; /* the time from one truth that teaches to the next */
    int64_t silence; /* after so long without a truth the fit stands in */
    at_real memory;  /* the same in seconds: in it what was learned fades, but for 1/e */
    at_real share;   /* of the fit, that it goes back to */
    at_real little;  /* a truth says little below */
    at_real rows;    /* as how many the fit counts, and the squares of their errors */
    at_real squares;
    at_real level;
    const at_real *start; /* coefficients of standardised regressors, the constant last, */
    const at_real *information; /* and the inverse of their covariance: a lower triangle row by row */
    int32_t ints;
    int32_t reals;
} at_learner;

typedef struct {
    int32_t trigger; /* the gather that lets it run; -1: it runs at every tick */
    int32_t slot;
    int32_t novelty_slot; /* -1 where nobody reads it; the same of the other */
    int32_t std_dev_slot;
    int32_t width;
    int32_t same; /* it repeats its only regressor */
    const at_entry *entries;
    at_real constant;
    const at_real *coefficients;
    const at_novelty *novelty; /* NULL where nobody heeds it; the same of the others */
    const at_variance *variance;
    const at_spread *spread;
    const at_learner *learner;
    int32_t outside;
    at_real centre;
} at_linear;

#define AT_AUTO_WEIGHTED 0
#define AT_MEAN 1
#define AT_MIDDLE 2
#define AT_BEST 3
#define AT_FALLBACK 4
#define AT_GUARD 5
#define AT_STATE_GATE 6
#define AT_HEDGE 7

#define AT_BY_TIME 0
#define AT_BY_COUNT 1
#define AT_FADING 2

#define AT_INVERSE_POWER 0
#define AT_AS_PRINTED 1
#define AT_AS_PRINTED_RAW 2

typedef struct {
    int32_t rule;
    int32_t voters;    /* the gather of the votes */
    int32_t state;     /* the gather of the state that it goes by; -1 */
    int32_t novelties; /* the gather of the novelties; -1 */
    const int32_t *which; /* the votes that these are of */
    int32_t slot;
    int32_t weights_slot; /* -1 where nobody reads them; the same of the others */
    int32_t reason_slot;
    int32_t novelty_slot;
    int32_t std_dev_slot;
    int32_t std_devs; /* the gather of those of the votes; -1 */
    int32_t truth; /* the slot of the truth; -1 */
    int64_t ahead;
    int64_t limit;
    int64_t embargo;
    int32_t runs;    /* room for so many runs and truths that wait, and for so many errors in so many rings */
    int32_t waiting;
    int32_t errors;
    int32_t rings;
    int32_t memory;
    int64_t longest; /* how long errors count */
    at_real half_life; /* of errors that fade, in seconds; 0 where they do not */
    int32_t form;
    at_real power;    /* of the mean square of the errors */
    at_real rate;     /* of a hedge, and whether it is found on the way */
    int32_t adaptive;
    at_real shrinkage;
    at_real floor;
    at_real share;
    at_real min_truths;
    at_real least_trust;
    int64_t dwell;
    int32_t ints;
    int32_t reals;
} at_vote;

typedef struct {
    at_real factor;
    at_real range;
    at_real rate;
    at_real slew;
    at_real deadband;
    int32_t stops;
    at_real below;
    at_real above;
} at_compensate_limits;

typedef struct {
    int32_t rate;
    int32_t state;     /* gathers; of none the count is 0 */
    int32_t realigned;
    int32_t slot;
    int32_t channels;
    const at_compensate_limits *limits;
    int32_t stops[3];
    int64_t max_gap;
    int32_t ints;
    int32_t reals;
} at_compensate;

typedef struct {
    int32_t gather;
    int32_t slot;
    int32_t channels;
    const at_real *stable;
    const at_real *transient;
    const at_real *hysteresis;
    int64_t dwell;
    int32_t ints;
} at_stability;

typedef struct {
    int32_t signal;
    int32_t distrust;
    int32_t slot;
    int32_t channels;
    const at_real *when_lost; /* NaN: hold */
    const at_real *slew;
    int64_t after;
    int64_t max_gap;
    int32_t ints;
    int32_t reals;
} at_safe_state;

typedef struct {
    int32_t position;
    int32_t applied;
    int32_t slot;
    int32_t channels;
    const at_real *factors;
    int32_t from_start;
    int32_t ints;
} at_uncorrected;

typedef struct {
    int32_t gather;
    int32_t slot;
    int32_t channels;
    const at_real *coefficients;
} at_loss;

typedef struct {
    int32_t loss;
    int32_t set_point;
    int32_t slot;
    at_real below;
    at_real change;
    int64_t hold;
    int64_t same_change;
    int64_t max_gap;
    int32_t ints;
    int32_t reals;
} at_settled;

typedef struct {
    int32_t gather;
    int32_t slot;
    int32_t channels;
} at_pick;

/* How sensors go together. */
typedef struct {
    int32_t signal; /* all channels now, then all of them a lag ago */
    int32_t slot;
    int32_t channels;
    int32_t columns;        /* of the fit; 0 where nothing was learned */
    const int32_t *places;  /* of each column among these values */
    const int32_t *own;     /* of each channel its two columns; -1 where there is none */
    const at_real *mean;
    const at_real *scale;
    const at_real *matrix;  /* a lower triangle row by row */
    at_real usual;
    at_real limit;
    int64_t lag;
    int64_t after;
    int64_t recover;
    int64_t longest;
    int32_t before;         /* all channels at the run of a truth and a lag before, and that truth; -1 where no truth decides */
    int32_t later;
    int32_t predicting;     /* columns that the truth is predicted from: those that are compared, and more */
    int64_t delay;          /* from such a run until its truth is known */
    int64_t span;
    const at_real *answers; /* the truth from all columns, and without each channel: a constant and coefficients */
    int32_t ints;
    int32_t reals;
} at_cross_check;

/* Each channel at the instants at which others are measured. */
typedef struct {
    int32_t signal;
    int32_t instants;
    int32_t slot;
    int32_t channels;
} at_sample_at;

/* Whether sensors can be trusted; times are -1 where nothing is checked. */
typedef struct {
    int32_t signal;
    int32_t slot;
    int32_t channels;
    const at_real *lowest;
    const at_real *highest;
    const at_real *rate;
    const at_real *quiet;
    const at_real *noisy;
    int64_t stuck;
    int64_t gap;
    int64_t pause; /* after which the count of the same value begins anew */
    int64_t recover;
    int32_t kept; /* squares of differences; 0 where noise is not looked at */
    int32_t ints;
    int32_t reals;
} at_health;

/* A series in which leaps are looked for. */
typedef struct {
    int32_t slot;
    int32_t ints;
    int32_t reals;
} at_course;

/* A truth over a window, which is absent where what it is taken over leapt within. */
typedef struct {
    int32_t slot;
    int32_t count;
    const at_course *courses;
    int64_t span;
} at_windowed;

#define AT_SLOPE 0
#define AT_LAG 1
#define AT_FIRST_ORDER 2
#define AT_LINEAR 3
#define AT_VOTE 4
#define AT_COMPENSATE 5
#define AT_STABILITY 6
#define AT_SAFE_STATE 7
#define AT_UNCORRECTED 8
#define AT_LOSS 9
#define AT_SETTLED 10
#define AT_PICK 11
#define AT_CROSS_CHECK 12
#define AT_SAMPLE_AT 13
#define AT_HEALTH 14
#define AT_WINDOWED 15
/* Parts of slopes, votes, estimators and comparisons, beside these kinds, that a graph may do without. */
#define AT_HEDGES 16
#define AT_ANY_POWER 17
#define AT_FADES 18
#define AT_LEARNS 19
#define AT_STD_DEVS 20
#define AT_FAST 21
#define AT_HINDSIGHT 22
#define AT_GATHER 23 /* as a step: reads whether anything in a gather is new */

/* What is done at a tick, in order: a kind and the number of its parameters in the table of that kind. */
typedef struct {
    int32_t kind;
    int32_t nth;
} at_step;

typedef struct {
    int32_t sources;
    int32_t slots;
    int32_t steps;
    int32_t gathers;
    int32_t histories;
    int32_t outputs;
    int32_t slot_ints;    /* where the stamps and ticks of slots lie, and what gathers found */
    int32_t gather_ints;
    int32_t rejected_ints;
    int32_t slot_reals;
    int32_t scratch;      /* room for what is needed within a step alone */
    int32_t ints;
    int32_t reals;
    int32_t saved;        /* of the numbers, how many are saved: what follows is made of them */
    uint64_t revision;    /* of the graph and its fit */
    const at_real *lowest;
    const at_real *highest;
    const at_step *step;
    const at_entry *entry;
    const at_gather *gather;
    const at_history *history;
    int32_t recorded;     /* of the histories, how many are of slots; the others belong to lags */
    const int32_t *output;
    const at_slope *slope;
    const at_lag *lag;
    const at_first_order *first_order;
    const at_linear *linear;
    const at_vote *vote;
    const at_compensate *compensate;
    const at_stability *stability;
    const at_safe_state *safe_state;
    const at_uncorrected *uncorrected;
    const at_loss *loss;
    const at_settled *settled;
    const at_pick *pick;
    const at_cross_check *cross_check;
    const at_sample_at *sample_at;
    const at_health *health;
    const at_windowed *windowed;
} at_plan;

/* The state of a plan. */
typedef struct {
    int64_t *i;
    at_real *r;
} at_memory;

/* Begins cold. */
void at_init(const at_plan *plan, at_memory m);

/* Takes the measurements of one instant, NaN where a channel has no new value, and gives the outputs, NaN where there is none. The first
 * tick after a state was loaded may have any time: before that of the state it begins another segment. */
uint32_t at_tick(const at_plan *plan, at_memory m, int64_t t_ns, const double in[], double out[]);

/* The next tick belongs to another segment: windows and lags start afresh, what was learned stays. */
void at_segment(const at_plan *plan, at_memory m);

/* The bytes that at_save writes: the state, independent of the order of bytes of the processor. */
size_t at_saved_size(const at_plan *plan);

/* Writes the state; 0 where there is too little room, else the number of bytes. */
size_t at_save(const at_plan *plan, const int64_t ints[], const at_real reals[], uint8_t bytes[], size_t room);

/* Goes on from a state; 0, or 1 where it is none of this plan or damaged: the state is as it was. */
int at_load(const at_plan *plan, at_memory m, const uint8_t bytes[], size_t length);

/* The bits of a number, and FNV-1a over bytes of it. */
uint64_t at_bits(double value);
uint64_t at_hash(uint64_t hash, uint64_t bits);
#define AT_HASH_BEGIN UINT64_C(0xcbf29ce484222325)

#endif
