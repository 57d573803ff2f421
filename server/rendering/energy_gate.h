/* The energy gate of a bridge: an energy tank that pays for every change of what is rendered, and a passivity
 * controller (two-layer tank: Franken et al., IEEE T-RO 2011; controller: Hannaford and Ryu, IEEE TRA 2002).
 *
 * Let W be the work of the hand on the device, -F . dx of the force really given, and E(x; theta) the energy stored
 * in the rendered contact. In a tick
 *   at the old theta   tank += W - (E(x; theta) - E(x_before; theta)): what damping and friction took
 *   a change of theta  only the share of it is made whose cost E(x; theta') - E(x; theta) is at most max(0, tank) +
 * leak dt, found by bisection; the tank pays it, or takes what it gives back a fade-out         its energy is dropped
 * and the tank keeps at most its maximum. Since E >= 0, the energy given to the hand, -sum W, never passes the tank at
 * the start + leak t + what the tank owes (tank < 0). While it owes and the handle moves, the passivity controller
 * damps; below its level at the start a little damping, which a hand hardly notices, fills it again, so that a model
 * that is held back comes soon. Energies are those at the device. Thread: [servo]; no heap, no locks. */
#ifndef PAL_RENDERING_ENERGY_GATE_H
#define PAL_RENDERING_ENERGY_GATE_H

typedef struct pal_energy_gate {
    double max_J, leak_W;        /* set by the caller */
    double tank_J, stored_J;     /* set tank_J at the start; stored: at the end of the last tick */
    double given_J, given_max_J; /* -sum W, and its largest value so far */
} pal_energy_gate;

/* the hand has done work_J, and the model before holds stored_J at the new pose */
void pal_energy_gate_work(pal_energy_gate *gate, double work_J, double stored_J);
/* what is stored was dropped to stored_J; nothing is credited */
void pal_energy_gate_drop(pal_energy_gate *gate, double stored_J);
/* Pays for a change: stored(user, share) is the energy with share in [0, 1] of it made. Returns the share */
double pal_energy_gate_pay(pal_energy_gate *gate, double dt_s, double (*stored)(const void *user, double share),
                           const void *user);
/* the end of a tick: stored_J is left, after friction and a change of the acting planes */
void pal_energy_gate_settle(pal_energy_gate *gate, double stored_J);
/* damping in N s/m that pays what the tank owes within a tick, or fills it */
double pal_energy_gate_damping(const pal_energy_gate *gate, double speed_m_s, double dt_s);
#endif
