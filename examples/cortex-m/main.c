/* Runs the self test of an exported graph on a Cortex-M, then counts the instructions of a tick once its windows are full: qemu with
 * `-icount shift=0` takes a nanosecond for each, and the timer of the core counts 25 of these a microsecond. */
#include NAME_H

#include <inttypes.h>
#include <stdio.h>

#define PASTE(a, b) a##b
#define JOIN(a, b) PASTE(a, b)
#define OF(what) JOIN(NAME, what)

static OF(_state) state;

static volatile uint32_t *const timer = (volatile uint32_t *)0xE000E010u;

static uint32_t instructions(void)
{
    return timer[2];
}

int main(void)
{
    double in[AT_INPUTS];
    double out[AT_OUTPUTS];
    double error = 0.0;
    uint64_t hash = 0;
    uint32_t worst = 0;
    uint64_t all = 0;
    const int differs = OF(_self_test_in)(&state, &error, &hash);
    /* As far as a long of 32 bits goes. */
    const long millionths = (long)(1.0e6 * ((error < 2147.0) ? error : 2147.0));
    int tick;

    timer[1] = 0xffffffu;
    timer[2] = 0;
    timer[0] = 5;
    for (tick = 1; tick <= (AT_WINDOW_TICKS + 20); tick++) {
        uint32_t before;
        uint32_t took;
        int nth;
        for (nth = 0; nth < AT_INPUTS; nth++) {
            /* Each channel lacks a sample now and then, which takes longer. */
            in[nth] = (((tick + nth) % 9) == 0) ? (double)NAN : (20.0 + (0.001 * (double)((tick * (nth + 3)) % 101)));
        }
        before = instructions();
        (void)OF(_step)(&state, (int64_t)tick * AT_PERIOD_NS, in, out);
        took = 40u * ((before - instructions()) & 0xffffffu);
        if (tick > AT_WINDOW_TICKS) {
            worst = (took > worst) ? took : worst;
            all += took;
        }
    }
    printf("self test %d, hash %08" PRIx32 "%08" PRIx32 ", error %ld millionths, %d bytes of state, %" PRIu32
           " instructions a tick, %" PRIu32 " at worst\n",
           differs, (uint32_t)(hash >> 32), (uint32_t)hash, millionths, (int)sizeof(state),
           (uint32_t)(all / 20u), worst);
    return (differs == 0) ? 0 : 1;
}
