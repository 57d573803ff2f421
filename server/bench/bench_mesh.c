/* `palpate bench mesh`: milliseconds of fill and split against paper B, Table 1 (bunny of 70,000 triangles, 1.5 GHz
 * Pentium 4), and the peak of resident memory. The time to read the file is printed but not included. Every run
 * allocates its memory again, so the figures include the page clearing of the kernel. */
#include "server/bench/bench.h"

#include "server/base/clock.h"
#include "server/mesh/files/mesh_file.h"
#include "server/mesh/voxel/voxels.h"
#include "server/num/median.h"

#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846
enum { N_CASE = 4, N_RUN = 9 };

typedef struct bench_case {
    int resolution;
    double paper_ms, limit_ms;
} bench_case;
static const bench_case cases[N_CASE] = {{30, 153, 8}, {75, 1980, 60}, {135, 10139, 250}, {165, 18287, 450}};

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

static pal_err run_case(const pal_surface *surface, const bench_case *c, pal_table *r, pal_diagnostic *diag)
{
    double fill[N_RUN], split[N_RUN], total[N_RUN], peak_bytes = 0, n_tet = 0;
    pal_voxel_options options = {.resolution = c->resolution, .border = true};
    pal_voxel_report report;
    /* VmHWM starts from the resident size */
    malloc_trim(0);
    FILE *file = fopen("/proc/self/clear_refs", "w");
    if (file) fputs("5", file), fclose(file);
    double resident = memory_of("VmRSS");
    for (int k = 0; k < N_RUN; k++) {
        pal_voxels voxels;
        pal_tets tets;
        double began = pal_clock_s();
        PAL_TRY(pal_voxels_fill(surface, &options, &voxels, &report, diag));
        double filled = pal_clock_s();
        pal_err err = pal_voxels_split(&voxels, &tets);
        double ended = pal_clock_s();
        pal_voxels_free(&voxels);
        if (err) return pal_diagnostic_set(diag, err, "cannot split at resolution %d", c->resolution);
        fill[k] = 1e3 * (filled - began), split[k] = 1e3 * (ended - filled), total[k] = 1e3 * (ended - began);
        if (k == 0) peak_bytes = memory_of("VmHWM") - resident;
        n_tet = tets.n_tet;
        pal_tets_free(&tets);
    }
    double total_ms = pal_median(total, N_RUN);
    TABLE_ROW(r, NUMBER("resolution", "resolution", 10, 0, c->resolution), NUMBER("tets", "tets", 9, 0, n_tet),
              TEXT("method", "method", -8, report.method), NUMBER("fill_ms", "fill ms", 8, 2, pal_median(fill, N_RUN)),
              NUMBER("split_ms", "split ms", 8, 2, pal_median(split, N_RUN)),
              NUMBER("total_ms", "total ms", 8, 2, total_ms), NUMBER("limit_ms", "limit ms", 8, 0, c->limit_ms),
              NUMBER(NULL, "ns/tet", 7, 1, 1e6 * total_ms / n_tet),
              NUMBER("peak_bytes_per_tet", "bytes/tet", 9, 0, peak_bytes / n_tet),
              NUMBER("paper_ms", "paper ms", 8, 0, c->paper_ms));
    return PAL_ERR_OK;
}

pal_err bench_mesh(pal_table *r, pal_diagnostic *diag)
{
    pal_surface surface = {0};
    const pal_mesh_file_options options = {.weld = 0};
    double read_ms = NAN, began = pal_clock_s();
    if (r->argument) {
        PAL_TRY(pal_mesh_file_read(r->argument, &options, &surface, NULL, NULL, NULL, diag));
        read_ms = 1e3 * (pal_clock_s() - began);
    } else {
        PAL_TRY(make_body(&surface));
    }
    TABLE_ROW(r, VALUE("triangles", surface.n_tri), VALUE("read_ms", read_ms), VALUE("runs", N_RUN));
    pal_table_note(r, "%d triangles, one thread, medians of %d; read in %.1f ms", surface.n_tri, N_RUN,
                   fmax(read_ms, 0));
    pal_table_list(r, "cases");
    pal_err err = PAL_ERR_OK;
    for (int k = 0; !err && k < N_CASE; k++) err = run_case(&surface, &cases[k], r, diag);
    pal_surface_free(&surface);
    return err;
}
