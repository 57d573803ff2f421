/* Solves the resolutions in turn and compares displacements at fixed points.
 *
 * Richardson's order is found by bisection, for meshes whose h has no fixed ratio: (h0^p - h1^p) / (h1^p - h2^p)
 * grows with p if h0 > h1 > h2. It applies to the magnitude of a change, not to the change itself. Where errors of
 * two kinds cancel (cut voxels and their interior), no p fits and no order is reported. */
#include "server/solve/convergence.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"

enum { POINTS_MAX = 4096 };

double pal_observed_order(double h_coarse, double coarse, double h_fine, double fine)
{
    bool known = h_coarse > 0 && h_fine > 0 && coarse > 0 && fine > 0 && h_coarse != h_fine;
    return known ? log(coarse / fine) / log(h_coarse / h_fine) : NAN;
}

double pal_richardson_order(const double h[3], double first, double second)
{
    if (!(h[0] > h[1] && h[1] > h[2] && h[2] > 0 && first > 0 && second > 0)) return NAN;
    double low = 0.05, high = 8, a = h[0] / h[1], b = h[2] / h[1], want = first / second;
    for (int k = 0; k < 80; k++) {
        double p = 0.5 * (low + high), ratio = (pow(a, p) - 1) / (1 - pow(b, p));
        *(ratio < want ? &low : &high) = p;
    }
    double p = 0.5 * (low + high);
    return p > 0.06 && p < 7.9 ? p : NAN;
}

void pal_convergence_orders(pal_convergence_point *point, int n)
{
    for (int k = 0; k < n; k++) {
        pal_convergence_point *now = &point[k], *before = k > 0 ? &point[k - 1] : NULL;
        double p = 1;
        now->order = now->change_order = now->estimate_percent = NAN;
        if (!before) continue;
        now->order =
            pal_observed_order(before->result.edge_m, before->rms_percent, now->result.edge_m, now->rms_percent);
        if (k > 1) {
            const double h[3] = {point[k - 2].result.edge_m, before->result.edge_m, now->result.edge_m};
            p = now->change_order = pal_richardson_order(h, before->change_percent, now->change_percent);
        }
        now->estimate_percent = now->change_percent / (pow(before->result.edge_m / now->result.edge_m, p) - 1);
    }
}

/* where displacements are compared: at the samples, or at vertices of the surface; frame of the problem */
static pal_err choose_points(const pal_surface *surface, const pal_samples *samples, double **x, int *n_out)
{
    int n = samples ? samples->n : surface->n_vertex, step = samples ? 1 : (n + POINTS_MAX - 1) / POINTS_MAX;
    *n_out = n = samples ? n : n / (step > 0 ? step : 1);
    pal_err err = PAL_ERR_OK;
    if (!PAL_ARRAY(&err, *x, 3 * (size_t)n)) return err;
    if (samples) memcpy(*x, samples->x, 3 * sizeof **x * (size_t)n);
    for (int i = 0; i < n && !samples; i++) pal_add3(*x + 3 * i, surface->x + 3 * (i * step), surface->origin_m);
    return err;
}

/* Writes displacements to u [n][3], and their differences from `before` [n][3] (NULL: none) and from the samples to
 * out. */
static void compare(const pal_solution *s, const double *x, int n, const pal_samples *samples, const double *before,
                    double *u, pal_convergence_point *out)
{
    double none;
    for (int i = 0; i < n; i++) pal_solution_at(s, x + 3 * i, u + 3 * i);
    out->rms_percent = out->max_percent = out->change_percent = NAN;
    if (samples) pal_samples_error(samples, u, &out->rms_percent, &out->max_percent);
    pal_samples now = {.n = n, .u = u};
    if (before) pal_samples_error(&now, before, &out->change_percent, &none);
}

pal_err pal_convergence(const pal_problem *problem, const pal_problem_case *load_case, const pal_surface *surface,
                        const pal_solve_options *options, const pal_samples *samples, const int *resolution, int n,
                        pal_convergence_point *out, int *n_done, pal_diagnostic *diag)
{
    double *x = NULL, *u[2] = {NULL, NULL};
    int n_point = 0, done = 0;
    if (n_done) *n_done = 0;
    if (n < 1 || n > PAL_CONVERGENCE_MAX)
        return PAL_REFUSE(diag, "%d resolutions, wanted 1 to %d", n, PAL_CONVERGENCE_MAX);
    for (int k = 1; k < n; k++)
        if (resolution[k] <= resolution[k - 1])
            return PAL_REFUSE(diag, "resolution %d comes after %d: wanted ascending ones", resolution[k],
                              resolution[k - 1]);
    pal_err err = choose_points(surface, samples, &x, &n_point);
    for (int k = 0; k < 2; k++) PAL_ARRAY(&err, u[k], 3 * (size_t)n_point);
    if (err) pal_diagnostic_set(diag, err, "no memory for %d points", n_point);
    for (; done < n && !err; done++) {
        pal_solution *s = NULL;
        pal_solve_options now = *options;
        out[done] = (pal_convergence_point){.resolution = resolution[done]};
        now.voxel.resolution = resolution[done];
        err = pal_solve(problem, load_case, surface, &now, &s, &out[done].result, diag);
        if (err) break;
        compare(s, x, n_point, samples, done ? u[(done + 1) & 1] : NULL, u[done & 1], &out[done]);
        pal_solution_free(s);
    }
    pal_convergence_orders(out, done);
    if (n_done) *n_done = done;
    PAL_FREE(x, u[0], u[1]);
    return err;
}
