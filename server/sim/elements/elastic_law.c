/* Elastic laws. */
#include "server/sim/elements/elastic_law.h"

#include "server/base/vec3.h"
#include "server/num/polar.h"

#include <string.h>

pal_err pal_elastic_law_read(pal_config_entry *item, pal_elastic_law *out, pal_diagnostic *diag)
{
    static const char *const names[] = {"corotational", "linear", "neo_hookean"};
    int law = PAL_LAW_COROTATIONAL;
    PAL_TRY(pal_entry_read_choice(item, "law", names, 3, &law, diag));
    *out = (pal_elastic_law)law;
    return PAL_ERR_OK;
}

void pal_lame(double young_Pa, double poisson, double *mu_Pa, double *lambda_Pa)
{
    *mu_Pa = young_Pa / (2 * (1 + poisson));
    *lambda_Pa = young_Pa * poisson / ((1 + poisson) * (1 - 2 * poisson));
}

void pal_cofactor3(const double f[9], double c[9])
{
    double r[9] = {f[4] * f[8] - f[5] * f[7], f[5] * f[6] - f[3] * f[8], f[3] * f[7] - f[4] * f[6],
                   f[2] * f[7] - f[1] * f[8], f[0] * f[8] - f[2] * f[6], f[1] * f[6] - f[0] * f[7],
                   f[1] * f[5] - f[2] * f[4], f[2] * f[3] - f[0] * f[5], f[0] * f[4] - f[1] * f[3]};
    memcpy(c, r, sizeof r);
}

void pal_linear_stress(double mu, double lambda, const double a[9], double p[9])
{
    double pressure = lambda * (a[0] + a[4] + a[8]);
    double xy = mu * (a[1] + a[3]), xz = mu * (a[2] + a[6]), yz = mu * (a[5] + a[7]);
    double sxx = 2 * mu * a[0] + pressure, syy = 2 * mu * a[4] + pressure, szz = 2 * mu * a[8] + pressure;
    p[0] = sxx, p[4] = syy, p[8] = szz;
    p[1] = p[3] = xy, p[2] = p[6] = xz, p[5] = p[7] = yz;
}

void pal_elastic_mul(double r[9], const double a[9], bool transposed, const double b[9])
{
    const int row = transposed ? 1 : 3, column = transposed ? 3 : 1;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            r[3 * i + j] = a[row * i] * b[j] + a[row * i + column] * b[3 + j] + a[row * i + 2 * column] * b[6 + j];
}

void pal_elastic_mult(double r[9], const double a[9], const double b[9])
{
    for (int i = 0; i < 9; i++) r[i] = pal_dot3(a + 3 * (i / 3), b + 3 * (i % 3));
}

double pal_corotational_stress(double mu, double lambda, const double f[9], const double r[9], double p[9])
{
    double e[9], sigma[9], sum = 0;
    pal_elastic_mul(e, r, true, f);
    for (int i = 0; i < 9; i += 4) e[i] -= 1;
    pal_linear_stress(mu, lambda, e, sigma);
    pal_elastic_mul(p, r, false, sigma);
    for (int i = 0; i < 9; i++) sum += sigma[i] * e[i];
    return 0.5 * sum;
}

/* from the largest eigenvalue of E = (F'F - I)/2, whose small numbers keep their digits */
double pal_largest_strain(const double f[9])
{
    double e[9], mean = 0, square = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            e[3 * i + j] = 0.5 * (f[i] * f[j] + f[3 + i] * f[3 + j] + f[6 + i] * f[6 + j] - (i == j));
    mean = (e[0] + e[4] + e[8]) / 3;
    for (int i = 0; i < 3; i++) e[4 * i] -= mean;
    for (int i = 0; i < 9; i++) square += e[i] * e[i];
    double p = sqrt(square / 6), rotation = p > 0 ? 0.5 * pal_det3(e) / (p * p * p) : 1;
    double max = mean + 2 * p * cos(acos(fmax(-1, fmin(1, rotation))) / 3), stretch2 = fmax(0, 1 + 2 * max);
    return (stretch2 - 1) / (sqrt(stretch2) + 1);
}

double pal_von_mises(const double s[9])
{
    double a = s[0] - s[4], b = s[4] - s[8], c = s[8] - s[0];
    double xy = 0.5 * (s[1] + s[3]), yz = 0.5 * (s[5] + s[7]), zx = 0.5 * (s[2] + s[6]);
    return sqrt(0.5 * (a * a + b * b + c * c) + 3 * (xy * xy + yz * yz + zx * zx));
}

double pal_neo_energy(double mu, double k1, const double f[9])
{
    /* in the displacement gradient, so that small strains do not drown in F:F - 3 */
    double a[9], c[9];
    for (int i = 0; i < 9; i++) a[i] = f[i] - (i % 4 == 0);
    pal_cofactor3(a, c);
    double trace = a[0] + a[4] + a[8], squares = 0;
    for (int i = 0; i < 9; i++) squares += a[i] * a[i];
    double second = c[0] + c[4] + c[8], third = a[0] * c[0] + a[1] * c[1] + a[2] * c[2];
    double j = trace + second + third; /* J - 1 */
    return 0.5 * mu * squares - mu * (second + third) + 0.5 * k1 * j * j;
}

void pal_neo_stress(double mu, double k1, double pressure, const double f[9], double p[9])
{
    double c[9];
    pal_cofactor3(f, c);
    double j = f[0] * c[0] + f[1] * c[1] + f[2] * c[2], s = -mu + k1 * (j - 1) + pressure;
    for (int i = 0; i < 9; i++) p[i] = mu * f[i] + s * c[i];
}

pal_err pal_elastic_regions_make(const pal_build *build, const int32_t *element, int n_element, int n_corner,
                                 int n_mean, pal_elastic_regions *out)
{
    *out = (pal_elastic_regions){0};
    if (build->def->n_region == 0) return PAL_ERR_OK;
    out->young_Pa = PAL_NEW(build->arena, double, n_element);
    out->poisson = PAL_NEW(build->arena, double, n_element);
    if (!out->young_Pa || !out->poisson) return PAL_ERR_MEMORY;
    for (int e = 0; e < n_element; e++) {
        double x[3] = {0};
        for (int c = 0; c < n_mean; c++)
            pal_axpy3(x, 1.0 / n_mean, build->body->x_rest + 3 * element[n_corner * e + c]);
        pal_material at, base = build->def->material;
        base.young_Pa = base.poisson = NAN;
        pal_material_overlay(build->def, &base, x, &at);
        out->young_Pa[e] = at.young_Pa;
        out->poisson[e] = at.poisson;
    }
    return PAL_ERR_OK;
}

void pal_elastic_regions_lame(const pal_elastic_regions *parts, const pal_material *material, int e, double *mu_Pa,
                              double *lambda_Pa)
{
    double young_Pa = material->young_Pa, poisson = material->poisson;
    if (parts->young_Pa && !isnan(parts->young_Pa[e])) young_Pa = parts->young_Pa[e];
    if (parts->poisson && !isnan(parts->poisson[e])) poisson = parts->poisson[e];
    pal_lame(young_Pa, fmin(poisson, PAL_POISSON_CLAMP), mu_Pa, lambda_Pa);
}
