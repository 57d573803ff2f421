/* Policy of the network side. Each constant states its unit, its reason, and the test that bounds it. Thread: any. */
#ifndef PAL_NET_TUNING_H
#define PAL_NET_TUNING_H

/* fraction of the diagonal of the scene's box: maximum distance of a picked point from the surface. Wide enough for a
 * pointer that sees an older frame (test_sculpt_hub) */
#define PAL_PICK_REACH 0.1
/* default softness of a brush: the load falls off over half of the radius (test_sculpt_hub) */
#define PAL_BRUSH_SOFTNESS 0.5
/* ns: within this time a peer joins, and the world answers a command about a component (test_ws, test_plan_hub) */
#define PAL_ANSWER_NS 5000000000u
/* ns without a turn of the loop, several times a second, after which a server is not alive (test_gameserver) */
#define PAL_PULSE_NS 2000000000u
/* ns without an acknowledgement after which a client is closed (protocol/README.md, "Cycles and credit"; test_hub) */
#define PAL_STALL_NS 10000000000u
/* ns: a client that skips a quarter of the cycles in this time gets coarser frames, and finer ones after five such
 * times without a skip, so that the tier does not oscillate (test_hub) */
#define PAL_TIER_WINDOW_NS 2000000000u
#define PAL_TIER_CLEAN_NS  (5ull * PAL_TIER_WINDOW_NS)
/* bound of the positions of each tier over that of the finest (test_hub) */
#define PAL_TIER_FACTORS                                                                                               \
    {                                                                                                                  \
        1, 2, 5                                                                                                        \
    }
/* 1/s: poses and acknowledgements of a client (protocol/README.md, "Limits"); as many as in half a second at once, so
 * that a delay of the server closes no client (test_ws) */
#define PAL_MESSAGES_1_S 600
/* 1/s: control messages of a client, far more than hands give on a page, and as many at once as a page sends when it
 * loads (test_hub) */
#define PAL_CONTROL_1_S     20
#define PAL_CONTROL_AT_ONCE 40
/* places that only instructors may take, but at most a quarter of all (test_hub) */
#define PAL_INSTRUCTOR_PLACES 4
/* members from one address of another machine without a ticket made for them (test_hub) */
#define PAL_ADDRESS_PLACES 32
/* viewers of one address of another machine: at least as many as members, else one of so many parts of all places. A
 * lecture hall comes by one address, and it takes some of them to keep others out (test_members_hub) */
#define PAL_VIEWING_ADDRESSES 4
/* viewers beyond all places whose ticket was made for them: a relay that comes back finds a place in a full server
 * (test_members_hub) */
#define PAL_VIEWING_TICKETS 16
/* connections that have not joined yet, in all and from one address; a further one takes the place of the oldest. A
 * client joins within a round trip or two (test_hub) */
#define PAL_UNJOINED_PLACES     64
#define PAL_UNJOINED_OF_ADDRESS 16
/* ns between two `members` messages of a session: an onlooker reads no more often (test_hub) */
#define PAL_MEMBERS_NS 250000000u
/* ns between two errors about poses to one client: a pose comes 250 times a second (test_hub) */
#define PAL_POSE_ERROR_NS 1000000000u
/* ns without a motion of PAL_STILL_M, m, after which a tool goes to who waits for one: longer than a trainee looks or
 * listens between two touches, above the trembling of a hand that lies on its device (test_hub) */
#define PAL_IDLE_NS 60000000000u
#define PAL_STILL_M 1e-3
/* s over which the error of a device's force is a mean: some models, and a few messages of status (test_hub) */
#define PAL_FORCE_ERROR_S 1.0
/* ns that a closing server waits for its clients to take the reason (test_ws) */
#define PAL_GOODBYE_NS 500000000u
/* Hz, at most: cycles, which displays cannot show faster; values of a field, which are colours (test_hub) */
#define PAL_STREAM_RATE_HZ  120.0
#define PAL_STREAM_FIELD_HZ 10.0
/* bytes a second of one interior, which limits the rate of large ones: as much as the frames of an organ that is
 * pulled; and tetrahedra, of more of which no page makes slices in time (test_fields_hub) */
#define PAL_INTERIOR_BYTES_S 4e5
#define PAL_INTERIOR_TETS    1000000
/* default bound of positions: m, below what a display resolves, and the number of such bounds in the longest side of
 * the box of a smaller scene (test_hub) */
#define PAL_POSITION_ERROR_M    5e-5
#define PAL_POSITIONS_IN_LENGTH 3000
/* 0xRRGGBB of tools in a recording, whose members it does not name: a grey that no member has (test_playback_hub) */
#define PAL_RECORDED_COLOUR 0xc0ccd6
/* simulated s awake after which an estimate does not bound a switch any more (test_switch_bound) */
#define PAL_HUB_ESTIMATE_OLD_S 1.0
/* commands that produce another scene: pending of a session and of a member, who clicks faster than they are made
 * (test_sculpt_hub); ns of the thread's time that a member may be ahead of its half (test_cost_hub) */
#define PAL_JOBS_PENDING   8
#define PAL_JOBS_OF_MEMBER 4
#define PAL_JOBS_TIME_NS   5000000000u
/* a scene that does not fit into its time may become this much dearer by trainees' commands in all: predictions are to
 * a fifth (test_cost_hub) */
#define PAL_DEARER 1.25
/* slowdown, and processor time of the steps over simulated time, above which, for so many ns, the last order is taken
 * back, and after as many more the one before; ns within which it must have been given. Repeated orders within
 * PAL_SLOW_NS are one (test_cost_hub) */
#define PAL_SLOW_MAX 2.0
#define PAL_SLOW_NS  3000000000u
#define PAL_BLAME_NS 10000000000u
/* keep_real_time: slowdown above which, for so many ns, quality falls; cost of the next configuration over the present
 * one, at most; share of a step that the dearer one may take for quality to rise after so many ns, long enough that it
 * does not oscillate (test_cost_hub) */
#define PAL_SLOW_MIN         1.1
#define PAL_QUALITY_SLOW_NS  5000000000u
#define PAL_CHEAPER          0.8
#define PAL_SPARE            0.7
#define PAL_QUALITY_SPARE_NS 20000000000u
/* rises of quality that double the time before the next: to some minutes (test_cost_hub) */
#define PAL_QUALITY_FALLS 4
/* scenes that wait to be opened; ns for which one that failed is listed; names of a folder that are listed
 * (test_sessions_hub) */
#define PAL_OPENINGS_MAX 8
#define PAL_FAILED_NS    60000000000u
#define PAL_SCENES_MAX   256
#endif
