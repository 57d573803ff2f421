/* palpate-client: scripted headless trainees against a server; load, latency, frame checks (scripted_client.h). */
#include "clients/link/client_flags.h"
#include "clients/scripted_client/end_condition.h"
#include "clients/scripted_client/scripted_client.h"
#include "protocol/field_codec.h"
#include "server/base/log.h"
#include "server/base/vec3.h"

#include <cjson/cJSON.h>
#include <signal.h>
#include <stdatomic.h>
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

/* a handler runs on any thread: lock-free atomics are safe there, and between threads as well */
static atomic_int main_signal;

static void main_on_signal(int number)
{
    main_signal = number;
}

static void main_asset(void *user, const pal_stored_asset *asset)
{
    crowd *c = user;
    for (int i = 0; i < c->n; i++) pal_scripted_client_asset_changed(c->trainee[i], asset);
}

/* ends early when asked to, when nobody is left, or when all have seen what they are there for */
static void main_watch(void *user)
{
    crowd *c = user;
    bool all = true, reached = true;
    for (int i = 0; i < c->n; i++) {
        all = all && pal_scripted_client_has_ended(c->trainee[i]);
        reached = reached && pal_end_condition_met(&c->until, pal_scripted_client_get_result(c->trainee[i]));
    }
    if (main_signal || all || reached) pal_link_stop(c->loop);
}

typedef struct totals {
    pal_samples latency, decode, gap;
    uint64_t frames, coarse, cycles, poses, bytes, asset_bytes, fields, field_bytes, patches, patch_bytes,
        fault[PAL_FAULT_COUNT];
    uint32_t triangles, places; /* of the last client */
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
    sum->patches += r->n_patch, sum->patch_bytes += r->patch_bytes;
    if (r->n_place) sum->triangles = r->n_triangle, sum->places = r->n_place;
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

static void main_put_samples(cJSON *object, const char *name, pal_samples *s)
{
    cJSON *o = cJSON_AddObjectToObject(object, name);
    cJSON_AddNumberToObject(o, "n", (double)s->n);
    cJSON_AddNumberToObject(o, "mean", pal_samples_mean(s));
    cJSON_AddNumberToObject(o, "p50", pal_samples_at(s, 0.5));
    cJSON_AddNumberToObject(o, "p99", pal_samples_at(s, 0.99));
    cJSON_AddNumberToObject(o, "max", s->max);
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
    cJSON *o = cJSON_CreateObject();
    cJSON_AddStringToObject(o, "order", reported->line->order.verb);
    cJSON_AddNumberToObject(o, "line", reported->line->number);
    cJSON_AddBoolToObject(o, "done", reported->answer != NULL);
    cJSON_AddStringToObject(o, "text", reported->text);
    cJSON_AddNumberToObject(o, "answer_ms", reported->answer_ms);
    cJSON_AddNumberToObject(o, "frame_ms", reported->frame_ms);
    cJSON_AddNumberToObject(o, "gap_ms", reported->gap_ms);
    cJSON_AddNumberToObject(o, "moved_mm", reported->moved_m * 1e3);
    cJSON_AddNumberToObject(o, "epoch", reported->epoch);
    cJSON_AddNumberToObject(o, "vertices", reported->n_vertex);
    for (uint32_t i = 0; reported->answer && i < reported->answer->n_arg; i++)
        cJSON_AddNumberToObject(o, reported->answer->arg[i].key, reported->answer->arg[i].value);
    char *text = cJSON_PrintUnformatted(o);
    if (text) puts(text);
    fflush(stdout);
    cJSON_free(text);
    cJSON_Delete(o);
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
    cJSON *o = cJSON_CreateObject();
    const double seconds = sum->seconds > 0 ? sum->seconds : 1;
    cJSON_AddBoolToObject(o, "ok", ok);
    if (!ok) cJSON_AddStringToObject(o, "reason", reason);
    cJSON_AddNumberToObject(o, "clients", n_client);
    cJSON_AddNumberToObject(o, "joined", sum->joined);
    cJSON_AddNumberToObject(o, "with_tool", sum->with_tool);
    cJSON_AddNumberToObject(o, "seconds", sum->seconds);
    cJSON_AddNumberToObject(o, "frames", (double)sum->frames);
    cJSON_AddNumberToObject(o, "coarse_frames", (double)sum->coarse);
    cJSON_AddNumberToObject(o, "cycles", (double)sum->cycles);
    cJSON_AddNumberToObject(o, "poses", (double)sum->poses);
    cJSON_AddNumberToObject(o, "frames_per_s", (double)sum->frames / seconds / n_client);
    cJSON_AddNumberToObject(o, "cycles_per_s", (double)sum->cycles / seconds / n_client);
    cJSON_AddNumberToObject(o, "bytes_per_s", (double)sum->bytes / seconds / n_client);
    cJSON_AddNumberToObject(o, "asset_bytes", (double)sum->asset_bytes);
    cJSON_AddNumberToObject(o, "moved_mm", sum->moved_m * 1e3);
    cJSON_AddNumberToObject(o, "force_max_N", sum->force_N);
    if (sum->fields) {
        cJSON *field = cJSON_AddObjectToObject(o, "field");
        cJSON_AddNumberToObject(field, "n", (double)sum->fields);
        cJSON_AddNumberToObject(field, "per_s", main_field_rate(sum, n_client));
        cJSON_AddNumberToObject(field, "low", sum->field_low);
        cJSON_AddNumberToObject(field, "high", sum->field_high);
        cJSON_AddNumberToObject(field, "bytes_mean", (double)sum->field_bytes / (double)sum->fields);
    }
    if (sum->places) {
        cJSON *patches = cJSON_AddObjectToObject(o, "patches");
        cJSON_AddNumberToObject(patches, "n", (double)sum->patches);
        cJSON_AddNumberToObject(patches, "bytes_mean",
                                sum->patches ? (double)sum->patch_bytes / (double)sum->patches : 0);
        cJSON_AddNumberToObject(patches, "triangles", sum->triangles);
        cJSON_AddNumberToObject(patches, "places", sum->places);
    }
    main_put_samples(o, "latency_ms", &sum->latency);
    main_put_samples(o, "decode_ms", &sum->decode);
    main_put_samples(o, "gap_ms", &sum->gap);
    cJSON_AddNumberToObject(o, "reconnects", sum->reconnects);
    cJSON_AddNumberToObject(o, "topologies", sum->topologies);
    if (sum->n_order) cJSON_AddNumberToObject(o, "orders", sum->n_order);
    if (sum->n_order) cJSON_AddNumberToObject(o, "orders_refused", sum->n_refused);
    if (sum->stalls_done) cJSON_AddNumberToObject(o, "old_cycles_after_stall", sum->old_after_stall);
    if (sum->closed) cJSON_AddStringToObject(o, "closed", sum->closed);
    cJSON *faults = cJSON_AddObjectToObject(o, "faults");
    for (int i = 0; i < PAL_FAULT_COUNT; i++)
        cJSON_AddNumberToObject(faults, pal_fault_name((pal_fault)i), (double)sum->fault[i]);
    char *text = cJSON_PrintUnformatted(o);
    if (text) puts(text);
    cJSON_free(text);
    cJSON_Delete(o);
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
    if (sum->places)
        printf("patches:          %llu, %.0f bytes each, %u triangles drawn now of %u places\n",
               (unsigned long long)sum->patches, sum->patches ? (double)sum->patch_bytes / (double)sum->patches : 0,
               sum->triangles, sum->places);
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

static int main_run(crowd *c, const pal_scripted_client_options *base, double seconds, bool json, bool quiet)
{
    pal_diagnostic diag = {""};
    pal_log_set_level(PAL_LOG_WARN);
    pal_err err = pal_link_loop_create(&c->loop);
    const int wanted = base->n_client;
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
    if (json) main_json(&sum, wanted, !reason, reason);
    if (!json && !quiet && !err) main_table(&sum, wanted);
    if (reason) fprintf(stderr, "palpate-client: %s\n", reason);
    pal_samples_free(&sum.latency);
    pal_samples_free(&sum.decode);
    pal_samples_free(&sum.gap);
    return reason ? 1 : 0;
}

/* orders and what to wait for, where they are given; an exit code */
static int main_read(const char *sculpt, pal_orders *orders, const char *until, pal_end_condition *seen)
{
    pal_diagnostic diag = {""};
    if (until && !*until) {
        fputs("palpate-client: --until \"\" waits for nothing: NAME=N,... is wanted\n", stderr);
        return 2;
    }
    const int code =
        until && pal_end_condition_parse(seen, until, &diag) ? 2 : sculpt && pal_orders_load(orders, sculpt, &diag);
    if (code) fprintf(stderr, "palpate-client: %s\n", diag.text);
    return code;
}

int main(int argc, char **argv)
{
    const char *url = NULL, *name = "trainee", *script = "press", *tool = "any", *up = "0,0,1", *stall = NULL,
               *field = NULL, *sculpt = NULL, *until = NULL;
    double seconds = 5, rate = 120, clients = 1, slow = 0, depth = 0;
    bool json = false, quiet = false;
    int n_operand;
    const pal_client_flag flag[] = {
        {"--script", "NAME", PAL_CLIENT_TEXT, &script, 0, 0, NULL, "press | pull | circle | idle | FILE (press)"},
        {"--name", "NAME", PAL_CLIENT_TEXT, &name, 0, 0, NULL, "name among the members"},
        {"--tool", "N", PAL_CLIENT_TEXT, &tool, 0, 0, NULL, "tool to take: its index or any (any)"},
        {"--seconds", "S", PAL_CLIENT_NUMBER, &seconds, 0.1, 86400, NULL, "how long (5)"},
        {"--until", "NAME=N,...", PAL_CLIENT_TEXT, &until, 0, 0, NULL,
         "end before that once each client has seen so much:\n"
         "cycles, frames, answered, fields, patches, triangles, orders, topologies,\n"
         "cycles_of_it (the last topology's), members, joins, stalls, moved_mm, force_N, field_high"},
        {"--rate", "HZ", PAL_CLIENT_NUMBER, &rate, 1, 240, NULL, "poses per second (120)"},
        {"--clients", "N", PAL_CLIENT_NUMBER, &clients, 1, CLIENTS_MAX, NULL, "so many at once (1)"},
        {"--depth", "M", PAL_CLIENT_NUMBER, &depth, 1e-5, 1, NULL, "depth of a press in metres (8 % of the box)"},
        {"--up", "X,Y,Z", PAL_CLIENT_TEXT, &up, 0, 0, NULL, "from which side the organ is touched (0,0,1)"},
        {"--field", "NAME", PAL_CLIENT_TEXT, &field, 0, 0, NULL,
         "ask for displacement | von_mises | energy | stiffness | strain | distortion, check it"},
        {"--sculpt", "FILE", PAL_CLIENT_TEXT, &sculpt, 0, 0, NULL,
         "give these orders: lines of SECONDS VERB key=value ... [at=top]"},
        {"--slow", "BYTES_S", PAL_CLIENT_NUMBER, &slow, 1, 1e9, NULL, "read no faster than this"},
        {"--stall", "S", PAL_CLIENT_TEXT, &stall, 0, 0, "3", "read nothing for S seconds (3), then go on"},
        {"--json", NULL, PAL_CLIENT_SWITCH, &json, 0, 0, NULL, "one JSON object on stdout"},
        {"--quiet", NULL, PAL_CLIENT_SWITCH, &quiet, 0, 0, NULL, "say nothing unless something fails"},
    };
    const pal_client_table table = {
        "palpate-client",
        "URL [flags]",
        "Joins the session at ws://host:port/ws, moves a tool by a script, checks every frame and measures the time\n"
        "from pose to frame. Exit code 1 when a check failed.",
        flag,
        sizeof flag / sizeof flag[0],
        1,
        1};
    const int code = pal_client_flags_parse(&table, argc, argv, &url, &n_operand);
    if (code >= 0) return code;
    pal_scripted_client_options base = {.url = url,
                                        .name = name,
                                        .script = script,
                                        .field = field,
                                        .tool = PAL_WIRE_TOOL_ANY,
                                        .rate_hz = rate,
                                        .depth_m = depth,
                                        .n_client = (int)clients,
                                        .read_bytes_s = slow,
                                        .stall_s = stall ? atof(stall) : 0};
    if (strcmp(tool, "any")) base.tool = atoi(tool);
    if (!pal_client_parse_vector(up, base.up) || !pal_unit3(base.up, base.up, 1e-9) || base.tool >= PAL_WIRE_TOOL_MAX) {
        fprintf(stderr, "palpate-client: --up wants three numbers, --tool an index or any\n");
        return 2;
    }
    if (field && (pal_wire_field_find(field) == PAL_WIRE_FIELD_COUNT || !strcmp(field, "none"))) {
        fprintf(stderr,
                "palpate-client: --field wants displacement, von_mises, energy, stiffness, strain or distortion, not "
                "\"%s\"\n",
                field);
        return 2;
    }
    pal_orders orders = {.n_line = 0};
    pal_end_condition seen = {.any = false};
    const int bad = main_read(sculpt, &orders, until, &seen);
    if (bad) return bad;
    if (sculpt) base.orders = &orders;
    if (!quiet) base.reported = main_reported, base.user = &json;
    signal(SIGINT, main_on_signal);
    signal(SIGTERM, main_on_signal);
    crowd c = {.trainee = calloc((size_t)base.n_client, sizeof *c.trainee),
               .name = calloc((size_t)base.n_client, sizeof *c.name),
               .until = seen};
    const int result = c.trainee && c.name ? main_run(&c, &base, seconds, json, quiet) : 1;
    for (int i = 0; i < c.n; i++) pal_scripted_client_destroy(c.trainee[i]);
    pal_asset_store_destroy(c.store);
    free(c.trainee), free(c.name);
    pal_orders_free(&orders);
    return result;
}
