/* Elastic laws at a Gauss point, for tet_elastic and hex_elastic. 3x3 matrices are
 * row-major, F[3 r + c] = dx_r / dX_c; a 9x9 matrix H[9 i + j] has i, j running over the entries of F.
 *
 * Neo-Hookean: the stable form of Smith, de Goes, Kim 2018 without their term at the origin,
 *     W(F) = mu/2 (F:F - 3) - mu (J - 1) + k1/2 (J - 1)^2,  J = det F,
 * whose linearisation has the Lame constants mu and lambda = k1 - mu. A mean dilatation term of the caller (hex B-bar)
 * comes in as a pressure: P += pressure dJ/dF, H += pressure d2J/dF2. Thread: any. */
#ifndef PAL_SIM_ELEMENTS_ELASTIC_LAW_H
#define PAL_SIM_ELEMENTS_ELASTIC_LAW_H
#include "server/sim/core/effect.h"
#include "server/sim/elements/tuning.h"

/* fields that elements measure */
enum {
    PAL_ELASTIC_FIELDS = 1 << PAL_FIELD_VON_MISES_PA | 1 << PAL_FIELD_ENERGY_J_M3 | 1 << PAL_FIELD_STRAIN |
                         1 << PAL_FIELD_DISTORTION | 1 << PAL_FIELD_YOUNG_PA | 1 << PAL_FIELD_DENSITY_KG_M3
};

/* what a pass over elements computes: forces are added, the energy is returned */
typedef enum pal_element_run { PAL_RUN_FORCE = 1, PAL_RUN_ENERGY = 2, PAL_RUN_BOTH = 3 } pal_element_run;
typedef enum pal_elastic_law { PAL_LAW_COROTATIONAL, PAL_LAW_LINEAR, PAL_LAW_NEO_HOOKEAN } pal_elastic_law;

/* key "law": corotational (default), linear or neo_hookean; REFUSED names another. [load] */
pal_err pal_elastic_law_read(pal_config_entry *item, pal_elastic_law *out, pal_diagnostic *diag);
void pal_lame(double young_Pa, double poisson, double *mu_Pa, double *lambda_Pa);
static inline double pal_lame_young_Pa(double mu_Pa, double lambda_Pa)
{
    return mu_Pa * (3 * lambda_Pa + 2 * mu_Pa) / (lambda_Pa + mu_Pa);
}

/* r = a b (transposed: a' b); r = a b'; r apart from a and b */
void pal_elastic_mul(double r[9], const double a[9], bool transposed, const double b[9]);
void pal_elastic_mult(double r[9], const double a[9], const double b[9]);
/* dJ/dF: det F F^-T, for singular F too */
void pal_cofactor3(const double f[9], double c[9]);
/* p = mu (A + A') + lambda tr A I with A = a; stress of a displacement gradient, small strain */
void pal_linear_stress(double mu, double lambda, const double a[9], double p[9]);
/* P of the corotational law with rotation r (polar part of F): r (2 mu e + lambda tr e I), e = sym(r'F) - I; returns
 * the energy mu e:e + lambda/2 (tr e)^2 */
double pal_corotational_stress(double mu, double lambda, const double f[9], const double r[9], double p[9]);
/* largest principal stretch of F - 1, independent of rotation */
double pal_largest_strain(const double f[9]);
/* sqrt(3/2) of the length of the deviator of a symmetric stress */
double pal_von_mises(const double stress[9]);

double pal_neo_energy(double mu, double k1, const double f[9]); /* J/m^3 */
void pal_neo_stress(double mu, double k1, double pressure, const double f[9], double p[9]);

/* E and nu of each element that a region gives (NaN: the body's), which a live edit of the body's material keeps */
typedef struct pal_elastic_regions {
    double *young_Pa, *poisson; /* NULL: no regions [n_element] */
} pal_elastic_regions;
/* regions are evaluated at the mean of the first `n_mean` corners of each element; arena memory. [load] */
pal_err pal_elastic_regions_make(const pal_build *build, const int32_t *element, int n_element, int n_corner,
                                 int n_mean, pal_elastic_regions *out);
/* Lame constants of element e in a body of this material; ratios above PAL_POISSON_CLAMP are taken as that */
void pal_elastic_regions_lame(const pal_elastic_regions *parts, const pal_material *material, int e, double *mu_Pa,
                              double *lambda_Pa);
#endif
