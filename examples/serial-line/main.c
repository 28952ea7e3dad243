/* Steps an exported graph over samples that come on a serial line, and answers each line with what it gives: a loop for Linux.
 *
 *     athermal export c MODEL -o exported
 *     make EXPORT=exported NAME=die_tester
 *     ./die_tester /dev/ttyUSB0 115200 machine.state
 *
 * A line is one instant: `temperature.plate1=21.53 position.X1=120.5`, channels in the units of the graph, each that has a new sample. `t=` gives its time in
 * nanoseconds; without it the clock of this computer does. The answer is a line too: `said=0 predicted.X1=0.173`, with what NAME_step says, how many
 * words were skipped where any were, and each output that has a value. The state is saved once a minute and at the end, and gone on from. */
#define _DEFAULT_SOURCE
#include NAME_H

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define PASTE(a, b) a##b
#define JOIN(a, b) PASTE(a, b)
#define OF(what) JOIN(NAME, what)

/* Longer words than names and numbers are none, and so are longer lines than all of them. */
#define LONGEST_LINE (128 * (AT_INPUTS + 1))
#define LONGEST_ANSWER (128 * (AT_OUTPUTS + 1))

static OF(_state) state;
static uint8_t saved[AT_SAVED_BYTES];
static volatile sig_atomic_t ends = 0;

static void end(int signal)
{
    (void)signal;
    ends = 1;
}

static int64_t now_ns(clockid_t clock)
{
    struct timespec now;
    (void)clock_gettime(clock, &now);
    return ((int64_t)now.tv_sec * INT64_C(1000000000)) + (int64_t)now.tv_nsec;
}

static speed_t speed_of(const char *baud)
{
    static const struct {
        const char *name;
        speed_t speed;
    } known[] = { { "9600", B9600 },     { "19200", B19200 },   { "38400", B38400 },
                  { "57600", B57600 },   { "115200", B115200 }, { "230400", B230400 } };
    size_t nth;
    for (nth = 0; nth < (sizeof(known) / sizeof(known[0])); nth++) {
        if (strcmp(baud, known[nth].name) == 0) {
            return known[nth].speed;
        }
    }
    fprintf(stderr, "%s baud is no speed of this example: 9600, 19200, 38400, 57600, 115200 or 230400\n", baud);
    exit(2);
}

/* A line without echo, whose bytes come as they are; -1 while it is not there. */
static int opened(const char *path, speed_t speed)
{
    struct termios how;
    const int line = open(path, O_RDWR | O_NOCTTY);
    if (line < 0) {
        return -1;
    }
    if (tcgetattr(line, &how) == 0) {
        cfmakeraw(&how);
        how.c_cflag |= (tcflag_t)(CLOCAL | CREAD);
        (void)cfsetspeed(&how, speed);
        (void)tcsetattr(line, TCSANOW, &how);
    }
    return line;
}

/* The state is written beside the file and then takes its place, so that there is always a whole one. */
static void save(const char *path)
{
    char beside[4096];
    FILE *file;
    size_t bytes;
    int well;
    (void)snprintf(beside, sizeof(beside), "%s.new", path);
    file = fopen(beside, "wb");
    if (file == NULL) {
        fprintf(stderr, "%s: %s; the state is not saved\n", beside, strerror(errno));
        return;
    }
    bytes = OF(_save)(&state, saved, sizeof(saved));
    well = (fwrite(saved, 1, bytes, file) == bytes) && (fflush(file) == 0) && (fsync(fileno(file)) == 0);
    if ((fclose(file) != 0) || !well || (rename(beside, path) != 0)) {
        fprintf(stderr, "%s: %s; the state is not saved\n", path, strerror(errno));
    }
}

static void go_on(const char *path)
{
    FILE *file = fopen(path, "rb");
    OF(_init)(&state);
    if (file != NULL) {
        const size_t bytes = fread(saved, 1, sizeof(saved), file);
        if (OF(_load)(&state, saved, bytes) != 0) {
            fprintf(stderr, "%s is no state of this graph: it begins cold\n", path);
        }
        (void)fclose(file);
    }
}

/* Takes the words of a line; how many were skipped. */
static int taken(char *line, double in[], int64_t *t_ns, int *count)
{
    int skipped = 0;
    char *rest = NULL;
    char *word;
    for (word = strtok_r(line, " \t\r", &rest); word != NULL; word = strtok_r(NULL, " \t\r", &rest)) {
        char *value = strchr(word, '=');
        char *after = NULL;
        int nth = 0;
        if (value == NULL) {
            skipped++;
            continue;
        }
        *value = '\0';
        value++;
        if (strcmp(word, "t") == 0) {
            const long long t = strtoll(value, &after, 10);
            if ((after != value) && (*after == '\0')) {
                *t_ns = (int64_t)t;
                (*count)++;
            } else {
                skipped++;
            }
            continue;
        }
        while ((nth < AT_INPUTS) && (strcmp(word, OF(_input_names)[nth]) != 0)) {
            nth++;
        }
        if (nth < AT_INPUTS) {
            const double sample = strtod(value, &after);
            if ((after != value) && (*after == '\0')) {
                in[nth] = sample;
                (*count)++;
                continue;
            }
        }
        skipped++;
    }
    return skipped;
}

static void say(int line, const char *answer, size_t length)
{
    size_t written = 0;
    while (written < length) {
        const ssize_t more = write(line, &answer[written], length - written);
        if (more <= 0) {
            /* Whoever asked is away; the next line is read all the same. */
            return;
        }
        written += (size_t)more;
    }
}

/* One line is one instant. */
static void step(int serial, char *line)
{
    static char answer[LONGEST_ANSWER];
    double in[AT_INPUTS];
    double out[AT_OUTPUTS];
    int64_t t_ns = now_ns(CLOCK_REALTIME);
    int count = 0;
    size_t length = 0;
    int skipped;
    int nth;
    for (nth = 0; nth < AT_INPUTS; nth++) {
        in[nth] = (double)NAN;
    }
    skipped = taken(line, in, &t_ns, &count);
    if (count > 0) {
        const int said = OF(_step)(&state, t_ns, in, out);
        length += (size_t)snprintf(answer, sizeof(answer), "said=%d", said);
        for (nth = 0; nth < AT_OUTPUTS; nth++) {
            if (!isnan(out[nth]) && ((length + 128) < sizeof(answer))) {
                length += (size_t)snprintf(&answer[length], sizeof(answer) - length, " %.90s=%.17g",
                                           OF(_output_names)[nth], out[nth]);
            }
        }
    }
    if (skipped > 0) {
        length += (size_t)snprintf(&answer[length], sizeof(answer) - length, "%sskipped=%d", (length > 0) ? " " : "", skipped);
    }
    answer[length] = '\n';
    say(serial, answer, length + 1);
}

int main(int count, char *words[])
{
    static char line[LONGEST_LINE];
    struct sigaction action;
    size_t length = 0;
    int too_long = 0;
    int serial = -1;
    int64_t due;
    if (count != 4) {
        fprintf(stderr, "usage: %s DEVICE BAUD STATE\n", words[0]);
        return 2;
    }
    {
        const speed_t speed = speed_of(words[2]);
        const int differs = OF(_self_test)();
        if (differs != 0) {
            fprintf(stderr, "tick %d of the self test is not that of the engine: build with -std=c99 -ffp-contract=off\n", differs);
            return 1;
        }
        memset(&action, 0, sizeof(action));
        action.sa_handler = end;
        (void)sigaction(SIGTERM, &action, NULL);
        (void)sigaction(SIGINT, &action, NULL);
        go_on(words[3]);
        due = now_ns(CLOCK_MONOTONIC) + INT64_C(60000000000);
        while (!ends) {
            struct pollfd wait;
            char byte;
            if (serial < 0) {
                serial = opened(words[1], speed);
            }
            wait.fd = serial;
            wait.events = POLLIN;
            wait.revents = 0;
            /* A line that is away is looked for once a second. */
            if (poll(&wait, 1, 1000) > 0) {
                const ssize_t read_bytes = read(serial, &byte, 1);
                if ((read_bytes == 0) || ((read_bytes < 0) && (errno != EINTR))) {
                    (void)close(serial);
                    serial = -1;
                    length = 0;
                    (void)poll(NULL, 0, 1000);
                } else if (read_bytes == 1) {
                    if (byte != '\n') {
                        too_long |= (length + 1) >= sizeof(line);
                        line[length] = byte;
                        length += (too_long != 0) ? 0u : 1u;
                    } else {
                        line[length] = '\0';
                        if (too_long == 0) {
                            step(serial, line);
                        } else {
                            say(serial, "skipped=1\n", 10);
                        }
                        length = 0;
                        too_long = 0;
                    }
                } else {
                    /* Interrupted: it may have to end. */
                }
            }
            if (now_ns(CLOCK_MONOTONIC) > due) {
                save(words[3]);
                due = now_ns(CLOCK_MONOTONIC) + INT64_C(60000000000);
            }
        }
    }
    save(words[3]);
    return 0;
}
