/* palpate-client: scripted headless trainees against a server; load, latency, frame checks (scripted_client.h). */
#include "clients/link/end_condition.h"
#include "clients/scripted_client/scripted_client.h"
#include "protocol/field_codec.h"
#include "server/base/flags.h"
#include "server/base/json_members.h"
#include "server/base/log.h"
#include "server/base/vec3.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CLIENTS_MAX = 1000 };

typedef struct crowd {
    pal_link_loop *loop;
    pal_asset_store *store;
    pal_scripted_client **trainee;
    int n;
    char (*name)[PAL_WIRE_MEMBER_NAME];
    pal_end_condition until;
} crowd;

static void main_asset(void *user, const pal_stored_asset *asset)
{
    crowd *c = user;
    for (int i = 0; i < c->n; i++) pal_scripted_client_asset_changed(c->trainee[i], asset);
}

/* ends early when nobody is left, or when all have seen what they are there for */
static void main_watch(void *user)
{
    crowd *c = user;
    bool all = true, reached = true;
    for (int i = 0; i < c->n; i++) {
        all = all && pal_scripted_client_has_ended(c->trainee[i]);
        double seen[PAL_CLIENT_SEEN_COUNT];
        pal_client_seen(pal_scripted_client_get_result(c->trainee[i]), seen);
        reached = reached && pal_end_condition_met(&c->until, seen);
    }
    if (all || reached) pal_link_stop(c->loop);
}

typedef struct totals {
    pal_samples latency, decode, gap;
    uint64_t frames, coarse, cycles, poses, bytes, asset_bytes, fields, field_bytes, deltas, delta_bytes,
        fault[PAL_FAULT_COUNT];
    uint32_t triangles, slots; /* of the last client */
    int joined, with_tool, reconnects, old_after_stall, stalls_done, silent, unanswered;
    int without_field, ungiven, n_order, n_refused;
    uint32_t topologies;
    double seconds, moved_m, force_N, field_low, field_high, field_s;
    const char *first_fault, *closed, *refused;
} totals;

static void main_add(totals *sum, const pal_scripted_client_result *r)
{
    pal_samples_merge(&sum->latency, &r->latency_ms);
    pal_samples_merge(&sum->decode, &r->decode_ms);
    pal_samples_merge(&sum->gap, &r->gap_ms);
    sum->frames += r->n_frame, sum->coarse += r->n_coarse, sum->cycles += r->n_cycle, sum->poses += r->n_pose,
        sum->bytes += r->bytes_in;
    sum->asset_bytes += r->asset_bytes;
    if (r->n_field) sum->field_low = sum->fields ? fmin(sum->field_low, r->field_low) : r->field_low;
    sum->field_high = fmax(sum->field_high, r->field_high);
    sum->fields += r->n_field, sum->field_bytes += r->field_bytes, sum->field_s += r->field_s;
    sum->deltas += r->n_delta, sum->delta_bytes += r->delta_bytes;
    if (r->n_slot) sum->triangles = r->n_triangle, sum->slots = r->n_slot;
    sum->without_field += r->joined && r->n_field == 0;
    sum->ungiven += r->joined && !r->field_given;
    for (int i = 0; i < PAL_FAULT_COUNT; i++) sum->fault[i] += r->fault[i];
    sum->joined += r->joined, sum->with_tool += r->tool >= 0;
    sum->reconnects += r->joins > 1 ? (int)r->joins - 1 : 0;
    sum->old_after_stall += (int)r->n_old_after_stall, sum->stalls_done += r->stall_done;
    sum->silent += r->n_cycle == 0;
    sum->unanswered += r->n_pose > 50 && r->latency_ms.n == 0;
    sum->n_order += r->n_order, sum->n_refused += r->n_refused, sum->topologies += r->n_topology;
    if (!sum->refused && r->refused[0]) sum->refused = r->refused;
    sum->seconds = fmax(sum->seconds, r->seconds);
    sum->moved_m = fmax(sum->moved_m, r->moved_m), sum->force_N = fmax(sum->force_N, r->force_N);
    if (!sum->first_fault && r->first_fault[0]) sum->first_fault = r->first_fault;
    if (!sum->closed && r->closed[0]) sum->closed = r->closed;
}

static cJSON *samples_json(pal_samples *s)
{
    return PAL_JSON({"n", JSON_NUMBER(s->n)}, {"mean", JSON_NUMBER(pal_samples_mean(s))},
                    {"p50", JSON_NUMBER(pal_samples_at(s, 0.5))}, {"p99", JSON_NUMBER(pal_samples_at(s, 0.99))},
                    {"max", JSON_NUMBER(s->max)});
}

/* one line for each order */
static void main_reported(void *user, const pal_order_result *reported)
{
    if (!*(const bool *)user) {
        printf("%s%s", reported->answer ? "" : "refused: ", reported->text);
        if (reported->frame_ms > 0)
            printf("; epoch %u, %u vertices, seen after %.0f ms, longest gap %.0f ms", reported->epoch,
                   reported->n_vertex, reported->frame_ms, reported->gap_ms);
        if (reported->moved_m > 0) printf("; moved %.1f mm", reported->moved_m * 1e3);
        printf("\n");
        fflush(stdout);
        return;
    }
    const pal_order_result *r = reported;
    cJSON *o = PAL_JSON({"order", JSON_TEXT(r->line->order.verb)}, {"line", JSON_NUMBER(r->line->number)},
                        {"done", JSON_BOOL(r->answer != NULL)}, {"text", JSON_TEXT(r->text)},
                        {"answer_ms", JSON_NUMBER(r->answer_ms)}, {"frame_ms", JSON_NUMBER(r->frame_ms)},
                        {"gap_ms", JSON_NUMBER(r->gap_ms)}, {"given_s", JSON_NUMBER(r->given_s)},
                        {"answered_s", JSON_NUMBER(r->answered_s)}, {"moved_mm", JSON_NUMBER(r->moved_m * 1e3)},
                        {"epoch", JSON_NUMBER(r->epoch)}, {"vertices", JSON_NUMBER(r->n_vertex)});
    for (uint32_t i = 0; r->answer && i < r->answer->n_arg; i++)
        cJSON_AddNumberToObject(o, r->answer->arg[i].key, r->answer->arg[i].value);
    (void)pal_json_write(stdout, o);
}

/* fields a second that one client got */
static double main_field_rate(const totals *sum, int n_client)
{
    return sum->field_s > 0 && sum->fields > (uint64_t)n_client
               ? (double)(sum->fields - (uint64_t)n_client) / sum->field_s
               : 0;
}

static void main_json(totals *sum, int n_client, bool ok, const char *reason)
{
    const double per_s = 1 / (sum->seconds > 0 ? sum->seconds : 1) / n_client;
    cJSON *field = NULL, *deltas = NULL, *faults = cJSON_CreateObject();
    if (sum->fields)
        field = PAL_JSON({"n", JSON_NUMBER(sum->fields)}, {"per_s", JSON_NUMBER(main_field_rate(sum, n_client))},
                         {"low", JSON_NUMBER(sum->field_low)}, {"high", JSON_NUMBER(sum->field_high)},
                         {"bytes_mean", JSON_NUMBER((double)sum->field_bytes / (double)sum->fields)});
    if (sum->slots)
        deltas = PAL_JSON({"n", JSON_NUMBER(sum->deltas)},
                          {"bytes_mean", JSON_NUMBER(sum->deltas ? (double)sum->delta_bytes / (double)sum->deltas : 0)},
                          {"triangles", JSON_NUMBER(sum->triangles)}, {"slots", JSON_NUMBER(sum->slots)});
    for (int i = 0; i < PAL_FAULT_COUNT; i++)
        cJSON_AddNumberToObject(faults, pal_fault_name((pal_fault)i), (double)sum->fault[i]);
    cJSON *report = PAL_JSON(
        {"ok", JSON_BOOL(ok)}, {"reason", ok ? NULL : JSON_TEXT(reason)}, {"clients", JSON_NUMBER(n_client)},
        {"joined", JSON_NUMBER(sum->joined)}, {"with_tool", JSON_NUMBER(sum->with_tool)},
        {"seconds", JSON_NUMBER(sum->seconds)}, {"frames", JSON_NUMBER(sum->frames)},
        {"coarse_frames", JSON_NUMBER(sum->coarse)}, {"cycles", JSON_NUMBER(sum->cycles)},
        {"poses", JSON_NUMBER(sum->poses)}, {"frames_per_s", JSON_NUMBER((double)sum->frames * per_s)},
        {"cycles_per_s", JSON_NUMBER((double)sum->cycles * per_s)},
        {"bytes_per_s", JSON_NUMBER((double)sum->bytes * per_s)}, {"asset_bytes", JSON_NUMBER(sum->asset_bytes)},
        {"moved_mm", JSON_NUMBER(sum->moved_m * 1e3)}, {"force_max_N", JSON_NUMBER(sum->force_N)}, {"field", field},
        {"topology_deltas", deltas}, {"latency_ms", samples_json(&sum->latency)},
        {"decode_ms", samples_json(&sum->decode)}, {"gap_ms", samples_json(&sum->gap)},
        {"reconnects", JSON_NUMBER(sum->reconnects)}, {"topologies", JSON_NUMBER(sum->topologies)},
        {"orders", sum->n_order ? JSON_NUMBER(sum->n_order) : NULL},
        {"orders_refused", sum->n_order ? JSON_NUMBER(sum->n_refused) : NULL},
        {"old_cycles_after_stall", sum->stalls_done ? JSON_NUMBER(sum->old_after_stall) : NULL},
        {"closed", sum->closed ? JSON_TEXT(sum->closed) : NULL}, {"faults", faults});
    (void)pal_json_write(stdout, report);
}

static void main_table(totals *sum, int n_client)
{
    const double seconds = sum->seconds > 0 ? sum->seconds : 1;
    printf("%d of %d joined, %d with a tool, %.1f s\n", sum->joined, n_client, sum->with_tool, sum->seconds);
    printf("frames %.1f/s each, cycles %.1f/s, %.0f bytes/s, vertices moved %.2f mm, force at most %.2f N\n",
           (double)sum->frames / seconds / n_client, (double)sum->cycles / seconds / n_client,
           (double)sum->bytes / seconds / n_client, sum->moved_m * 1e3, sum->force_N);
    printf("pose to frame ms: p50 %.2f  p99 %.2f  max %.2f  (%llu poses answered)\n",
           pal_samples_at(&sum->latency, 0.5), pal_samples_at(&sum->latency, 0.99), sum->latency.max,
           (unsigned long long)sum->latency.n);
    printf("decode ms:        p50 %.2f  p99 %.2f  max %.2f\n", pal_samples_at(&sum->decode, 0.5),
           pal_samples_at(&sum->decode, 0.99), sum->decode.max);
    if (sum->fields)
        printf("field:            %.1f/s each, values from %.4g to %.4g, %.0f bytes each\n",
               main_field_rate(sum, n_client), sum->field_low, sum->field_high,
               (double)sum->field_bytes / (double)sum->fields);
    if (sum->slots)
        printf("topology deltas:  %llu, %.0f bytes each, %u triangles drawn now in %u slots\n",
               (unsigned long long)sum->deltas, sum->deltas ? (double)sum->delta_bytes / (double)sum->deltas : 0,
               sum->triangles, sum->slots);
    for (int i = 0; i < PAL_FAULT_COUNT; i++)
        if (sum->fault[i]) printf("%s: %llu\n", pal_fault_name((pal_fault)i), (unsigned long long)sum->fault[i]);
}

/* the verdict: what failed first, or NULL */
static const char *main_verdict(const totals *sum, int n_client, const char *field, const pal_orders *orders)
{
    static char reason[400];
    if (sum->first_fault) return sum->first_fault;
    if (sum->joined < n_client) {
        snprintf(reason, sizeof reason, "%d of %d clients never joined: %.200s", n_client - sum->joined, n_client,
                 sum->closed ? sum->closed : "no answer");
        return reason;
    }
    if (sum->silent) return "a client saw no cycle";
    if (sum->frames == 0) return "no frame came";
    if (sum->unanswered) return "poses were never echoed";
    if (sum->refused) return sum->refused;
    if (orders && sum->n_order < orders->n_line) {
        snprintf(reason, sizeof reason, "%d of %d orders were answered", sum->n_order, orders->n_line);
        return reason;
    }
    if (!field || !sum->without_field) return NULL;
    if (sum->ungiven)
        snprintf(reason, sizeof reason, "no body of the session gives the field %.64s", field);
    else
        snprintf(reason, sizeof reason, "no %.64s came to %d of %d clients", field, sum->without_field, n_client);
    return reason;
}

static int main_run(crowd *c, const pal_scripted_client_options *base, double seconds, const pal_flag_common *common)
{
    pal_diagnostic diag = {""};
    pal_log_set_level(PAL_LOG_WARN);
    pal_err err = pal_link_loop_create(&c->loop);
    const int wanted = base->n_client;
    if (!err) err = pal_link_stop_on_signals(c->loop);
    if (!err) c->store = pal_asset_store_create(c->loop, base->url, main_asset, c);
    if (!err && !c->store) err = PAL_ERR_MEMORY;
    for (int i = 0; i < wanted && !err; i++) {
        pal_scripted_client_options one = *base;
        one.index = i;
        if (i > 0) one.orders = NULL;
        snprintf(c->name[i], sizeof c->name[i], wanted > 1 ? "%.20s %d" : "%.31s", base->name, i + 1);
        one.name = c->name[i];
        err = pal_scripted_client_open(c->loop, c->store, &one, &diag, &c->trainee[i]);
        c->n += !err;
    }
    if (!err) {
        pal_link_add_timer(c->loop, 50000, main_watch, c);
        pal_link_run_for(c->loop, seconds);
    }
    totals sum = {0};
    for (int i = 0; i < c->n; i++) main_add(&sum, pal_scripted_client_get_result(c->trainee[i]));
    pal_link_loop_destroy(c->loop);
    const char *reason =
        err ? (diag.text[0] ? diag.text : pal_err_text(err)) : main_verdict(&sum, wanted, base->field, base->orders);
    if (common->json) main_json(&sum, wanted, !reason, reason);
    if (!common->json && !common->quiet && !err) main_table(&sum, wanted);
    if (reason) fprintf(stderr, "palpate-client: %s\n", reason);
    pal_samples_free(&sum.latency);
    pal_samples_free(&sum.decode);
    pal_samples_free(&sum.gap);
    return reason ? 1 : 0;
}

/* orders and what to wait for, where they are given; an exit code, 0: continue */
static int main_read(const pal_flag_common *common, const char *sculpt, pal_orders *orders, const char *until,
                     pal_end_condition *seen)
{
    pal_diagnostic diag = {""};
    if (until && !*until) return pal_flags_wrong(common, "--until \"\" waits for nothing: NAME=N,... is wanted");
    if (until && pal_end_condition_parse(seen, pal_client_seen_name, PAL_CLIENT_SEEN_COUNT, until, &diag))
        return pal_flags_wrong(common, "%s", diag.text);
    if (!sculpt || !pal_orders_load(orders, sculpt, &diag)) return 0;
    fprintf(stderr, "palpate-client: %s\n", diag.text);
    return 1;
}

int main(int argc, char **argv)
{
    const char *tool = "any", *stall = NULL, *sculpt = NULL, *until = NULL;
    double seconds = 5;
    pal_flag_common common;
    pal_scripted_client_options base = {.name = "trainee",
                                        .script = "press",
                                        .tool = PAL_WIRE_TOOL_ANY,
                                        .rate_hz = 120,
                                        .n_client = 1,
                                        .up = {0, 0, 1}};
    const pal_flag flag[] = {
        {"--script", "NAME", PAL_FLAG_TEXT, &base.script, 0, 0, "press | pull | circle | idle | FILE (press)"},
        {"--name", "NAME", PAL_FLAG_TEXT, &base.name, 0, 0, "name among the members"},
        {"--tool", "N", PAL_FLAG_TEXT, &tool, 0, 0, "tool to take: its index or any (any)"},
        {"--seconds", "S", PAL_FLAG_NUMBER, &seconds, 0.1, 86400, "how long (5)"},
        {"--until", "NAME=N,...", PAL_FLAG_TEXT, &until, 0, 0,
         "end before that once each client has seen so much:\n"
         "cycles, frames, answered, fields, deltas, triangles, orders, topologies,\n"
         "cycles_of_it (the last topology's), members, joins, stalls, cycles_after_stall,\n"
         "moved_mm, force_N, field_high"},
        {"--rate", "HZ", PAL_FLAG_NUMBER, &base.rate_hz, 1, 240, "poses per second (120)"},
        {"--clients", "N", PAL_FLAG_COUNT, &base.n_client, 1, CLIENTS_MAX, "so many at once (1)"},
        {"--depth", "M", PAL_FLAG_NUMBER, &base.depth_m, 1e-5, 1, "depth of a press in metres (8 % of the box)"},
        {"--up", "X,Y,Z", PAL_FLAG_VECTOR, base.up, 0, 0, "from which side the organ is touched (0,0,1)"},
        {"--field", "NAME", PAL_FLAG_TEXT, &base.field, 0, 0,
         "ask for displacement | von_mises | energy | stiffness | strain | distortion | young |\n"
         "density | damping"},
        {"--sculpt", "FILE", PAL_FLAG_TEXT, &sculpt, 0, 0,
         "give these orders: lines of SECONDS VERB key=value ... [at=top]"},
        {"--slow", "BYTES_S", PAL_FLAG_NUMBER, &base.read_bytes_s, 1, 1e9, "read no faster than this"},
        {"--stall", "S", PAL_FLAG_OPTIONAL, &stall, 0, 0, "read nothing for S seconds (3), then go on"},
    };
    const pal_flag_table table = {
        .program = "palpate-client",
        .usage = "URL [flags]",
        .about = "Joins the session at ws://host:port/ws, moves a tool by a script, checks "
                 "every frame and measures the time\n"
                 "from pose to frame. Exit code 1 when a check failed. URL is quoted and has the ticket\n"
                 "that palpate serve prints: 'http://127.0.0.1:8090/#TICKET'; PALPATE_TICKET may have\n"
                 "it too, and a server with --open needs none.\n",
        PAL_FLAGS(flag),
        .operands = {1, 1}};
    const int code = pal_flags_parse(&table, argc, argv, &common, &base.url, NULL);
    if (code >= 0) return code;
    if (stall) base.stall_s = *stall ? atof(stall) : 3;
    if (strcmp(tool, "any")) base.tool = atoi(tool);
    if (!pal_unit3(base.up, base.up, 1e-9) || base.tool >= PAL_WIRE_TOOL_MAX)
        return pal_flags_wrong(&common, "--up wants a direction, --tool an index or any");
    if (base.field && (pal_wire_field_find(base.field) == PAL_WIRE_FIELD_COUNT || !strcmp(base.field, "none")))
        return pal_flags_wrong(&common,
                               "--field wants displacement, von_mises, energy, stiffness, strain, distortion, young, "
                               "density or damping, not \"%s\"",
                               base.field);
    pal_orders orders = {.n_line = 0};
    pal_end_condition seen = {.any = false};
    const int bad = main_read(&common, sculpt, &orders, until, &seen);
    if (bad) return bad;
    if (sculpt) base.orders = &orders;
    if (!common.quiet) base.reported = main_reported, base.user = &common.json;
    crowd c = {.trainee = calloc((size_t)base.n_client, sizeof *c.trainee),
               .name = calloc((size_t)base.n_client, sizeof *c.name),
               .until = seen};
    const int result = c.trainee && c.name ? main_run(&c, &base, seconds, &common) : 1;
    for (int i = 0; i < c.n; i++) pal_scripted_client_destroy(c.trainee[i]);
    pal_asset_store_destroy(c.store);
    free(c.trainee), free(c.name);
    pal_orders_free(&orders);
    return result;
}
