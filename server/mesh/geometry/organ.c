/* A liver-like body: two smoothly joined ellipsoids (a large right and a thin left lobe), with a fissure between them
 * and a hollow below, as the zero set of a blend of distance-like functions, contoured and decimated. */
#include "server/mesh/geometry/organ.h"

#include "server/base/vec3.h"
#include "server/mesh/geometry/contour.h"
#include "server/mesh/geometry/decimate.h"
#include "server/mesh/geometry/smooth.h"
#include "server/mesh/geometry/tuning.h"

/* about the signed distance to an ellipsoid, positive inside: exact at the surface to first order */
static double ellipsoid(const double p[3], const double middle[3], const double axis[3])
{
    double u[3], v[3];
    for (int a = 0; a < 3; a++) {
        u[a] = (p[a] - middle[a]) / axis[a];
        v[a] = u[a] / axis[a];
    }
    double k0 = pal_norm3(u), k1 = pal_norm3(v);
    return k1 > 1e-9 ? k0 * (1 - k0) / k1 : fmin(axis[0], fmin(axis[1], axis[2]));
}

/* the larger (sign 1) or smaller (sign -1) of two distances, rounded where they are within r of each other */
static double blend(double a, double b, double r, double sign)
{
    double t = fmax(r - fabs(a - b), 0) / r, side = sign > 0 ? fmax(a, b) : fmin(a, b);
    return side + sign * t * t * r / 4;
}

static double liver(const void *self, const double p[3])
{
    (void)self;
    /* x to the body's left, y up, z to the front, in metres */
    double right = ellipsoid(p, (const double[3]){-0.035, 0, 0}, (const double[3]){0.070, 0.065, 0.058});
    double left = ellipsoid(p, (const double[3]){0.045, 0.018, 0.012}, (const double[3]){0.062, 0.036, 0.034});
    double body = blend(right, left, 0.035, 1);
    double hollow = ellipsoid(p, (const double[3]){0.015, -0.085, -0.012}, (const double[3]){0.075, 0.060, 0.062});
    double fissure = ellipsoid(p, (const double[3]){0.022, -0.030, 0.058}, (const double[3]){0.012, 0.045, 0.030});
    return blend(blend(body, -hollow, 0.030, -1), -fissure, 0.020, -1);
}

pal_err pal_organ_make(int n_tri_about, pal_surface *out)
{
    int n = n_tri_about < 500 ? 500 : n_tri_about > 500000 ? 500000 : n_tri_about;
    /* about 0.065 m^2 of surface */
    pal_contour_box box = {{-0.13, -0.09, -0.08}, {0.13, 0.09, 0.08}, 0};
    box.spacing_m = fmin(sqrt(CONTOUR_TRI_PER_SPACING2 * 0.065 / (CONTOUR_SURPLUS * n)), 0.006);
    pal_surface organ;
    PAL_TRY(pal_contour(liver, NULL, &box, &organ, NULL));
    pal_err err = pal_surface_smooth(&organ, 5, NULL);
    if (!err) err = pal_surface_decimate(&organ, n);
    if (err) {
        pal_surface_free(&organ);
        return err;
    }
    pal_surface_recentre(&organ);
    *out = organ;
    return PAL_ERR_OK;
}
