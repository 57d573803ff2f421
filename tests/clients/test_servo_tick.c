/* A tick of the servo calls no heap, takes no lock and writes nothing, in every state: counted by wrapped calls of the
 * C library in the process, between the first and the last instruction of a tick. */
#include "tests/check.h"
#include "tests/clients/tissue_server.h"
#include "tests/heap_calls.h"

#include <pthread.h>
#include <stdarg.h>

int __real_pthread_mutex_lock(pthread_mutex_t *mutex);
int __wrap_pthread_mutex_lock(pthread_mutex_t *mutex);
ssize_t __real_write(int file, const void *bytes, size_t n);
ssize_t __wrap_write(int file, const void *bytes, size_t n);
int __wrap_printf(const char *format, ...);
int __wrap_fprintf(FILE *file, const char *format, ...);

int __wrap_pthread_mutex_lock(pthread_mutex_t *mutex)
{
    count_heap_call();
    return __real_pthread_mutex_lock(mutex);
}
ssize_t __wrap_write(int file, const void *bytes, size_t n)
{
    count_heap_call();
    return __real_write(file, bytes, n);
}
int __wrap_printf(const char *format, ...)
{
    va_list list;
    count_heap_call();
    va_start(list, format);
    const int n = vprintf(format, list);
    va_end(list);
    return n;
}
int __wrap_fprintf(FILE *file, const char *format, ...)
{
    va_list list;
    count_heap_call();
    va_start(list, format);
    const int n = vfprintf(file, format, list);
    va_end(list);
    return n;
}

/* the rig allocates nothing either between its creation and its end */
static void counted(tissue_rig *r, double seconds)
{
    counting = true;
    tissue_run(r, seconds);
    counting = false;
}

static void wrapped_calls_are_seen(void)
{
    pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
    counting = true;
    void *volatile block = malloc(8);
    free(block);
    pthread_mutex_lock(&mutex);
    printf("  %d calls before this one\n", 3);
    counting = false;
    pthread_mutex_unlock(&mutex);
    CHECK_INT(n_heap_call, 4);
    n_heap_call = 0;
}

static void tick_in_every_state_calls_no_heap_lock_or_output(void)
{
    const pal_servo_options plain = {0};
    const tissue_options o = {
        .k1 = 200, .k2 = 9000, .mu = 0.3, .kt = 100, .grasp_k = 60, .k_jitter = 0.2, .rtt_s = 0.05};
    tissue_rig r;
    REQUIRE(tissue_open(&r, "inverse3,script=grasp,clock=virtual", &o, &plain));
    counted(&r, 9); /* arming, free, contact, grasp */
    CHECK_INT(r.view.state, PAL_SERVO_CONTACT);
    CHECK(r.view.n_model > 300);
    r.silent = true;
    counted(&r, 0.3);
    CHECK_INT(r.view.state, PAL_SERVO_STALE);
    counted(&r, 1);
    r.silent = false;
    counted(&r, 0.5);
    pal_servo_put_generation(r.servo, 2);
    r.generation = 2;
    counted(&r, 0.5);
    pal_servo_estop(r.servo);
    counted(&r, 0.1);
    CHECK_INT(r.view.state, PAL_SERVO_ESTOP);
    pal_servo_rearm(r.servo);
    counted(&r, 2);
    pal_wire_haptic bad = {.seq = 1u << 30, .n_patch = 1, .patch[0].k1_N_m = NAN};
    pal_servo_put_model(r.servo, &bad, 2, r.now_ns);
    counted(&r, 0.1);
    CHECK_INT(r.view.n_not_finite, 1);
    CHECK(tissue_event(&r, PAL_EVENT_FAULT));
    CHECK_INT(n_heap_call, 0);
    tissue_close(&r);
}

int main(void)
{
    RUN(wrapped_calls_are_seen);
    RUN(tick_in_every_state_calls_no_heap_lock_or_output);
    return check_report();
}
