/* How an MPS2 board begins: the table of vectors, the unit for numbers, then main. Output goes through semihosting. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

extern uint32_t stack_top;
extern uint8_t bss_begin;
extern uint8_t bss_end;

extern void initialise_monitor_handles(void);
extern int main(void);

void reset(void);
void _init(void);
void _fini(void);

/* What newlib expects of a system of its own. */
void _init(void)
{
}

void _fini(void)
{
}

void reset(void)
{
#if defined(__ARM_FP)
    /* Lets everybody use the floating-point unit. */
    *(volatile uint32_t *)0xE000ED88u |= (0xFu << 20);
    __asm volatile("dsb\n\tisb");
#endif
    (void)memset(&bss_begin, 0, (size_t)(&bss_end - &bss_begin));
    initialise_monitor_handles();
    exit(main());
}

__attribute__((section(".vectors"), used)) static const void *const vectors[] = {
    &stack_top,
    (const void *)reset,
};
