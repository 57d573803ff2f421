/* Credit and token bucket. The smallest round trip is kept over two windows of 10 s, so that one that has grown for
 * good (another network) is believed after at most 20 s. At the end of each window one cycle goes alone. The first
 * window is of 1 s, since a client is slow while it loads. */
#include "server/net/transport/credit.h"

#include "server/net/transport/tuning.h"

#include <math.h>
#include <string.h>

#define WINDOW_NS       10000000000u
#define FIRST_WINDOW_NS 1000000000u

void pal_credit_begin(pal_credit *credit, double rate_hz)
{
    memset(credit, 0, sizeof *credit);
    credit->rate_hz = rate_hz;
    credit->max = 3;
    credit->limit = 3;
    credit->fastest_s = HUGE_VAL;
    credit->min_s[0] = credit->min_s[1] = HUGE_VAL;
}

bool pal_credit_free(const pal_credit *credit)
{
    return credit->n_flight < (credit->probing ? 1 : credit->max);
}

void pal_credit_sent(pal_credit *credit, uint32_t cycle, uint64_t now_ns)
{
    if (credit->n_flight == PAL_CREDIT_MAX) return;
    if (credit->n_flight == 0) {
        credit->heard_ns = now_ns;
        credit->first_alone = true;
    }
    credit->cycle[credit->n_flight] = cycle;
    credit->sent_ns[credit->n_flight++] = now_ns;
}

static double smallest_s(const pal_credit *c)
{
    return fmin(c->min_s[0], c->min_s[1]);
}

/* what covers the round trip and a segment that TCP sends again */
static void set_max(pal_credit *c)
{
    const double whole = 1 + ceil(c->rate_hz * (smallest_s(c) + PAL_CREDIT_STALL_S));
    c->limit = fmin(c->limit, whole);
    c->max = (int)fmax(PAL_CREDIT_MIN, fmin(floor(c->limit), PAL_CREDIT_MAX));
}

/* do cycles queue in the line? */
static void judge(pal_credit *c, double rtt_s, int n, uint64_t now_ns)
{
    const double small_s = smallest_s(c);
    c->fastest_s = fmin(c->fastest_s, rtt_s);
    c->n_delivered += n;
    if (!c->judged_ns) c->judged_ns = now_ns;
    const double passed_s = 1e-9 * (double)(now_ns - c->judged_ns);
    if (passed_s < PAL_CREDIT_WINDOW_S || !isfinite(small_s)) return;
    double best_s = 0;
    c->delivered_s[c->n_window++ % PAL_CREDIT_WINDOWS] = c->n_delivered / passed_s;
    for (int k = 0; k < PAL_CREDIT_WINDOWS; k++) best_s = fmax(best_s, c->delivered_s[k]);
    if (c->fastest_s > small_s + fmax(PAL_CREDIT_QUEUE_S, small_s / 2))
        c->limit = fmin(c->limit, 1 + best_s * small_s);
    else
        c->limit *= PAL_CREDIT_GROWTH;
    c->limit = fmax(c->limit, PAL_CREDIT_MIN);
    c->judged_ns = now_ns, c->n_delivered = 0, c->fastest_s = HUGE_VAL;
    set_max(c);
}

static void learn(pal_credit *c, double rtt_s, bool alone, uint64_t now_ns)
{
    c->rtt_s = c->rtt_s > 0 ? c->rtt_s + 0.125 * (rtt_s - c->rtt_s) : rtt_s;
    if (c->window_ns == 0) c->window_ns = now_ns + FIRST_WINDOW_NS;
    if (now_ns > c->window_ns) {
        c->min_s[0] = c->min_s[1];
        c->min_s[1] = HUGE_VAL;
        c->window_ns = now_ns + WINDOW_NS;
        c->probing = true;
    }
    if (!alone) return;
    c->probing = false;
    const bool first = !isfinite(smallest_s(c));
    c->min_s[1] = fmin(c->min_s[1], rtt_s);
    if (first) c->limit = 1 + ceil(c->rate_hz * rtt_s);
    set_max(c);
}

bool pal_credit_acknowledge(pal_credit *credit, uint32_t cycle, uint64_t now_ns)
{
    int n = 0;
    while (n < credit->n_flight && (int32_t)(credit->cycle[n] - cycle) <= 0) n++;
    /* older acknowledgements are repeats; one of a future cycle is malformed */
    if (n == 0) return credit->acknowledged && (int32_t)(cycle - credit->acknowledged) <= 0;
    if (credit->cycle[n - 1] != cycle) return false;
    const double rtt_s = (double)(now_ns - credit->sent_ns[n - 1]) * 1e-9;
    learn(credit, rtt_s, n == 1 && credit->first_alone, now_ns);
    judge(credit, rtt_s, n, now_ns);
    credit->first_alone = false;
    credit->n_flight -= n;
    memmove(credit->cycle, credit->cycle + n, (size_t)credit->n_flight * sizeof *credit->cycle);
    memmove(credit->sent_ns, credit->sent_ns + n, (size_t)credit->n_flight * sizeof *credit->sent_ns);
    credit->heard_ns = now_ns;
    credit->acknowledged = cycle;
    return true;
}

bool pal_credit_stalled(const pal_credit *credit, uint64_t now_ns, uint64_t limit_ns)
{
    return credit->n_flight > 0 && now_ns > credit->heard_ns + limit_ns;
}

void pal_bucket_begin(pal_bucket *bucket, double per_s, double depth, uint64_t now_ns)
{
    *bucket = (pal_bucket){.level = depth, .depth = depth, .per_s = per_s, .at_ns = now_ns};
}

bool pal_bucket_take(pal_bucket *bucket, uint64_t now_ns)
{
    double past_s = (double)(now_ns - bucket->at_ns) * 1e-9;
    bucket->at_ns = now_ns;
    bucket->level = fmin(bucket->depth, bucket->level + past_s * bucket->per_s);
    if (bucket->level < 1) return false;
    bucket->level -= 1;
    return true;
}
