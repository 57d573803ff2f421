#include "server/rendering/energy_gate.h"
#include "server/rendering/tuning.h"

#include <math.h>

void pal_energy_gate_work(pal_energy_gate *gate, double work_J, double stored_J)
{
    gate->tank_J += work_J - (stored_J - gate->stored_J);
    gate->stored_J = stored_J;
    gate->given_J -= work_J;
    gate->given_max_J = fmax(gate->given_max_J, gate->given_J);
}

void pal_energy_gate_drop(pal_energy_gate *gate, double stored_J)
{
    gate->stored_J = stored_J;
}

double pal_energy_gate_pay(pal_energy_gate *gate, double dt_s, double (*stored)(const void *user, double share),
                           const void *user)
{
    const double leak = gate->leak_W * dt_s, before = gate->stored_J;
    const double max = before + fmax(0, gate->tank_J) + leak;
    double share = 1, after = stored(user, 1);
    if (!(after <= max)) {
        double low = 0, high = 1, at_low = stored(user, 0);
        for (int i = 0; i < GATE_BISECTIONS; i++) {
            const double middle = (low + high) / 2, at = stored(user, middle);
            if (at <= max)
                low = middle, at_low = at;
            else
                high = middle;
        }
        share = low, after = at_low;
    }
    const double cost = after - before;
    gate->tank_J -= cost > 0 ? fmax(0, cost - leak) : cost;
    gate->stored_J = after;
    return share;
}

void pal_energy_gate_settle(pal_energy_gate *gate, double stored_J)
{
    gate->tank_J = fmin(gate->tank_J + gate->stored_J - stored_J, gate->max_J);
    gate->stored_J = stored_J;
}

double pal_energy_gate_damping(const pal_energy_gate *gate, double speed_m_s, double dt_s)
{
    if (!(speed_m_s > REST_SPEED_M_S)) return 0;
    const double fill = REFILL_DAMPING_NS_M * fmin(fmax(1 - gate->tank_J / TANK_START_J, 0), 1);
    return fmax(fill, -gate->tank_J / (speed_m_s * speed_m_s * dt_s));
}
