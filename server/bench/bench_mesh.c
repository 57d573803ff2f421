/* palpate bench mesh: milliseconds of fill and split against paper B, Table 1 (bunny of 70k triangles, 1.5 GHz
 * Pentium 4), and the peak of resident memory. Reading the file is stated, not counted.
 *
 * Every run takes its memory afresh, so the kernel's page clearing is in the figures. */
#include "server/bench/bench.h"

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
    double fill_ms, split_ms, total_ms, peak_bytes; /* medians; peak over what was resident before */
    char method[16];
} result;

/* bumpy ellipsoid, as full in its box as the bunny (0.27), 69,696 triangles */
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

/* VmRSS or VmHWM in bytes; 0 where there is no such file */
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

/* lets VmHWM begin at what is resident now */
static void forget_peak(void)
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
    forget_peak();
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

static void print_table(const pal_surface *surface, double read_ms, const result *r)
{
    printf("mesh: %d triangles", surface->n_tri);
    if (read_ms >= 0) printf(", read in %.1f ms (not counted below)", read_ms);
    printf(", one thread, medians of %d\n", N_RUN);
    printf("resolution      tets  method      fill ms  split ms  total ms  limit ms  ns/tet  bytes/tet  paper ms\n");
    for (int k = 0; k < N_CASE; k++)
        printf("%10d %9lld  %-8s %10.2f %9.2f %9.2f %9.0f %7.1f %10.0f %9.0f\n", CASE[k].resolution, r[k].n_tet,
               r[k].method, r[k].fill_ms, r[k].split_ms, r[k].total_ms, CASE[k].limit_ms,
               1e6 * r[k].total_ms / (double)r[k].n_tet, r[k].peak_bytes / (double)r[k].n_tet, CASE[k].paper_ms);
}

static void print_json(const pal_surface *surface, double read_ms, const result *r)
{
    printf("{\"bench\":\"mesh\",\"triangles\":%d,\"read_ms\":%.3f,\"runs\":%d,\"cases\":[", surface->n_tri,
           read_ms < 0 ? 0 : read_ms, N_RUN);
    for (int k = 0; k < N_CASE; k++)
        printf("%s{\"resolution\":%d,\"tets\":%lld,\"method\":\"%s\",\"fill_ms\":%.3f,\"split_ms\":%.3f,"
               "\"total_ms\":%.3f,\"limit_ms\":%.0f,\"paper_ms\":%.0f,\"peak_bytes_per_tet\":%.1f}",
               k ? "," : "", CASE[k].resolution, r[k].n_tet, r[k].method, r[k].fill_ms, r[k].split_ms, r[k].total_ms,
               CASE[k].limit_ms, CASE[k].paper_ms, r[k].peak_bytes / (double)r[k].n_tet);
    printf("]}\n");
}

int bench_mesh(const char *ply_path_or_null, bool json)
{
    pal_surface surface = {0};
    pal_diagnostic diag = {.text = "out of memory"};
    result r[N_CASE];
    double read_ms = -1, began = pal_clock_s();
    pal_err err;
    if (ply_path_or_null) {
        pal_mesh_file_options options = {.weld = 0};
        err = pal_mesh_file_read(ply_path_or_null, &options, &surface, NULL, NULL, NULL, &diag);
        read_ms = 1e3 * (pal_clock_s() - began);
    } else {
        err = make_body(&surface);
    }
    for (int k = 0; !err && k < N_CASE; k++) err = run_case(&surface, CASE[k].resolution, &r[k], &diag);
    if (err)
        fprintf(stderr, "bench mesh: %s\n", diag.text);
    else if (json)
        print_json(&surface, read_ms, r);
    else
        print_table(&surface, read_ms, r);
    pal_surface_free(&surface);
    return err != 0;
}
