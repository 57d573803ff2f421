/* Lines of the log: their form, and how many a flood gets. */
#include "server/base/log.h"
#include "tests/check.h"

#include <time.h>
#include <unistd.h>

/* the clock of the log */
static struct timespec now = {.tv_sec = 1801440000, .tv_nsec = 123456789}; /* 2027-02-01T00:00:00Z */
int __wrap_clock_gettime(clockid_t clock, struct timespec *out);
int __real_clock_gettime(clockid_t clock, struct timespec *out);
int __wrap_clock_gettime(clockid_t clock, struct timespec *out)
{
    if (clock != CLOCK_REALTIME) return __real_clock_gettime(clock, out);
    *out = now;
    return 0;
}

static char text[1 << 17];
static FILE *file;
static int old;

static void begin(void)
{
    fflush(stderr);
    file = tmpfile();
    old = dup(2);
    dup2(fileno(file), 2);
}

/* number of lines */
static int end(void)
{
    fflush(stderr);
    dup2(old, 2);
    close(old);
    rewind(file);
    const size_t n = fread(text, 1, sizeof text - 1, file);
    text[n] = 0;
    fclose(file);
    int lines = 0;
    for (const char *at = text; (at = strchr(at, '\n')); at++) lines++;
    return lines;
}

static void a_line_has_its_time(void)
{
    begin();
    pal_log(PAL_LOG_WARN, "lcm", "%d of %s", 3, "seven");
    pal_log(PAL_LOG_DEBUG, "lcm", "nobody asked for this");
    CHECK_INT(end(), 1);
    CHECK_TEXT(text, "2027-02-01T00:00:00.123Z warn lcm: 3 of seven\n");
}

static void a_flood_is_counted(void)
{
    begin();
    for (int i = 0; i < 10000; i++) pal_log(PAL_LOG_INFO, "refused", "client %d", i);
    pal_log(PAL_LOG_INFO, "join", "another event has its own lines");
    now.tv_sec += 9;
    pal_log(PAL_LOG_INFO, "refused", "still too early");
    now.tv_sec += 1;
    pal_log(PAL_LOG_INFO, "refused", "later");
    CHECK_INT(end(), PAL_LOG_LINES + 1 + 2);
    CHECK(strstr(text, "info refused: 9801 lines like this were left out\n"));
    CHECK(strstr(text, "info refused: later\n"));
}

static void many_events_have_room(void)
{
    begin();
    for (int i = 0; i < 1000; i++) {
        char event[16];
        snprintf(event, sizeof event, "event%d", i);
        pal_log(PAL_LOG_INFO, event, "once");
    }
    const int n = end();
    CHECK(n >= PAL_LOG_LINES && n <= 1000); /* those beyond its table count as one */
}

int main(void)
{
    RUN(a_line_has_its_time);
    RUN(a_flood_is_counted);
    RUN(many_events_have_room);
    return check_report();
}
