#include "server/calibrate/calibrate_run.h"

#include <float.h>
#include <math.h>

const char *pal_calibrate_method(const pal_calibrate_run *run)
{
    return run->annealing ? "annealing" : "adjoint";
}

const char *pal_calibrate_key(const pal_calibrate_run *run, int k, bool brief)
{
    static const char *const name[PAL_SPRING_KINDS][2] = {
        {"k_distance_J", "k_d"}, {"k_area_J", "k_a"}, {"k_volume_J", "k_v"}};
    return name[run->info.kind[k]][brief];
}

double pal_calibrate_mean(const pal_calibrate_run *run, const pal_calibration_value *value, bool fit)
{
    double sum = 0;
    int n = 0;
    for (int k = 0; k < run->set.n; k++) {
        if (run->set.list[k].fit != fit) continue;
        if (!(value->case_percent[k] < DBL_MAX)) return DBL_MAX;
        sum += value->case_percent[k];
        n++;
    }
    return n > 0 ? sum / n : NAN;
}
