/* `palpate bench mesh`: milliseconds of fill and split against paper B, Table 1 (bunny of 70,000 triangles, 1.5 GHz
 * Pentium 4), and the peak of resident memory. The time to read the file is printed but not included. Every run
 * allocates anew, so the figures include the page clearing of the kernel. */
#include "server/bench/bench.h"
#include "server/bench/bench_report.h"

#include "server/base/clock.h"
#include "server/cli/median.h"
#include "server/mesh/files/mesh_file.h"
#include "server/mesh/voxel/voxels.h"

#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846
enum { N_CASE = 4, N_RUN = 9 };

static const struct bench_case {
    int resolution;
    double paper_ms, limit_ms;
} CASE[N_CASE] = {{30, 153, 8}, {75, 1980, 60}, {135, 10139, 250}, {165, 18287, 450}};

typedef struct result {
    long long n_tet;
    double fill_ms, split_ms, total_ms, peak_bytes; /* medians; peak above the resident size before */
    char method[16];
} result;

/* bumpy ellipsoid that fills its box as the bunny does (0.27), 69,696 triangles */
static pal_err make_body(pal_surface *out)
{
    enum { RING = 264, BAND = 133, INNER = BAND - 1, SOUTH = RING * INNER, NORTH = SOUTH + 1 };
    pal_surface s = {.n_vertex = RING * INNER + 2, .n_tri = 2 * RING * INNER};
    s.x = malloc((size_t)s.n_vertex * 3 * sizeof *s.x);
    s.tri = malloc((size_t)s.n_tri * 3 * sizeof *s.tri);
    if (!s.x || !s.tri) {
        pal_surface_free(&s);
        return PAL_ERR_MEMORY;
    }
    for (int v = 0; v < s.n_vertex; v++) {
        double a = 2 * PI * (v % RING) / RING, b = v < SOUTH ? PI * (v / RING + 1) / BAND : v == SOUTH ? 0 : PI;
        double r = 0.08 * (1 + 0.1 * sin(5 * a) * pow(sin(3 * b), 2)), *x = s.x + 3 * v;
        x[0] = r * sin(b) * cos(a), x[1] = 0.8 * r * sin(b) * sin(a), x[2] = -0.7 * r * cos(b);
    }
    int32_t *to = s.tri;
    for (int i = 0; i < RING; i++) {
        int next = (i + 1) % RING;
        int32_t caps[6] = {SOUTH, next, i, NORTH, (INNER - 1) * RING + i, (INNER - 1) * RING + next};
        memcpy(to, caps, sizeof caps);
        to += 6;
        for (int j = 0; j + 1 < INNER; j++, to += 6) {
            int32_t p = j * RING + i, q = j * RING + next, two[6] = {p, q, q + RING, p, q + RING, p + RING};
            memcpy(to, two, sizeof two);
        }
    }
    *out = s;
    return PAL_ERR_OK;
}

/* VmRSS or VmHWM in bytes; 0 without /proc */
static double memory_of(const char *name)
{
    char line[256];
    double kb = 0;
    FILE *file = fopen("/proc/self/status", "r");
    if (!file) return 0;
    while (fgets(line, sizeof line, file))
        if (!strncmp(line, name, strlen(name)) && line[strlen(name)] == ':') kb = atof(line + strlen(name) + 1);
    fclose(file);
    return 1024 * kb;
}

/* resets VmHWM to the resident size */
static void reset_peak(void)
{
    malloc_trim(0);
    FILE *file = fopen("/proc/self/clear_refs", "w");
    if (!file) return;
    fputs("5", file);
    fclose(file);
}

static pal_err run_case(const pal_surface *surface, int resolution, result *out, pal_diagnostic *diag)
{
    double fill[N_RUN], split[N_RUN], total[N_RUN];
    pal_voxel_options options = {.resolution = resolution, .border = true};
    reset_peak();
    double resident = memory_of("VmRSS");
    for (int k = 0; k < N_RUN; k++) {
        pal_voxels voxels;
        pal_voxel_report report;
        pal_tets tets;
        double began = pal_clock_s();
        PAL_TRY(pal_voxels_fill(surface, &options, &voxels, &report, diag));
        double filled = pal_clock_s();
        pal_err err = pal_voxels_split(&voxels, &tets);
        double ended = pal_clock_s();
        pal_voxels_free(&voxels);
        if (err) return pal_diagnostic_set(diag, err, "cannot split at resolution %d", resolution);
        fill[k] = 1e3 * (filled - began), split[k] = 1e3 * (ended - filled), total[k] = 1e3 * (ended - began);
        if (k == 0) out->peak_bytes = memory_of("VmHWM") - resident;
        out->n_tet = tets.n_tet;
        memcpy(out->method, report.method, sizeof out->method);
        pal_tets_free(&tets);
    }
    out->fill_ms = pal_median(fill, N_RUN);
    out->split_ms = pal_median(split, N_RUN);
    out->total_ms = pal_median(total, N_RUN);
    return PAL_ERR_OK;
}

int bench_mesh(const char *ply_path_or_null, bool json)
{
    pal_surface surface = {0};
    pal_diagnostic diag = {""};
    result all[N_CASE];
    double read_ms = NAN, began = pal_clock_s();
    pal_err err;
    if (ply_path_or_null) {
        pal_mesh_file_options options = {.weld = 0};
        err = pal_mesh_file_read(ply_path_or_null, &options, &surface, NULL, NULL, NULL, &diag);
        read_ms = 1e3 * (pal_clock_s() - began);
    } else {
        err = make_body(&surface);
    }
    for (int k = 0; !err && k < N_CASE; k++) err = run_case(&surface, CASE[k].resolution, &all[k], &diag);
    bench_report r;
    bench_begin(&r, "mesh", json);
    bench_number(&r, "triangles", NULL, 0, 0, surface.n_tri);
    bench_number(&r, "read_ms", NULL, 0, 0, read_ms);
    bench_number(&r, "runs", NULL, 0, 0, N_RUN);
    bench_note(&r, "%d triangles, one thread, medians of %d; read in %.1f ms", surface.n_tri, N_RUN, fmax(read_ms, 0));
    bench_list(&r, "cases");
    for (int k = 0; !err && k < N_CASE; k++) {
        const result *c = &all[k];
        bench_record(&r);
        bench_number(&r, "resolution", "resolution", 10, 0, CASE[k].resolution);
        bench_number(&r, "tets", "tets", 9, 0, (double)c->n_tet);
        bench_text(&r, "method", "method", -8, c->method);
        bench_number(&r, "fill_ms", "fill ms", 8, 2, c->fill_ms);
        bench_number(&r, "split_ms", "split ms", 8, 2, c->split_ms);
        bench_number(&r, "total_ms", "total ms", 8, 2, c->total_ms);
        bench_number(&r, "limit_ms", "limit ms", 8, 0, CASE[k].limit_ms);
        bench_number(&r, NULL, "ns/tet", 7, 1, 1e6 * c->total_ms / (double)c->n_tet);
        bench_number(&r, "peak_bytes_per_tet", "bytes/tet", 9, 0, c->peak_bytes / (double)c->n_tet);
        bench_number(&r, "paper_ms", "paper ms", 8, 0, CASE[k].paper_ms);
    }
    pal_surface_free(&surface);
    return bench_end(&r, err, &diag);
}
