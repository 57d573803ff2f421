/* Members of a server that nobody enters without a ticket: roles, rights that instructors give, tools that they hand
 * over, who is put out, and places. */
#include "server/net/admission/ticket_keys.h"
#include "server/net/transport/relay_list.h"
#include "server/net/tuning.h"
#include "tests/net/hub_scene.h"
#include "tests/net/server_fixture.h"

#include <unistd.h>

static small_scene organ;
static char ticket[PAL_WIRE_ROLE_COUNT][PAL_TICKET_TEXT];

static void begin_server(pal_server_options options)
{
    served_guarded = true;
    served_begin(&organ.scene, (pal_session_options){.start_paused = true}, options);
    for (int r = 0; r < PAL_WIRE_ROLE_COUNT; r++) pal_server_start_ticket(server, (pal_wire_role)r, ticket[r]);
}

static void begin_with(int max_clients, int max_viewers)
{
    begin_server((pal_server_options){.max_clients = max_clients, .max_viewers = max_viewers});
}

static void begin(int max_clients)
{
    begin_with(max_clients, 0);
}

/* a quarter of a second, in which all members hear what has changed */
static void turn(mem_client *a, mem_client *b)
{
    served_turn(250000000u, a, b);
    served_turn(1, a, b);
}

static void join(mem_client *c, const char *name, pal_wire_role role, int tool)
{
    mem_connect(c, transport, "", ticket[role]);
    mem_enter(c, name, role, tool, false);
    mem_pull(c, 1000);
}

static void order(mem_client *c, const char *verb, const char *target, const char *args)
{
    char text[512];
    snprintf(text, sizeof text, "{\"type\":\"command\",\"verb\":\"%s\",\"target\":\"%s\",\"args\":{%s}}", verb, target,
             args);
    mem_text(c, text);
}

static const pal_wire_member *member(const mem_client *seen_by, const mem_client *c)
{
    static const pal_wire_member none;
    const pal_wire_members *members = &seen_by->last[PAL_CONTROL_MEMBERS].members;
    for (uint32_t i = 0; i < members->n_member; i++)
        if (members->member[i].id == c->last[PAL_CONTROL_HELLO].hello.you_id) return &members->member[i];
    return &none;
}

static int id_of(const mem_client *c)
{
    return c->last[PAL_CONTROL_HELLO].hello.you_id;
}

static const char *error_code(const mem_client *c)
{
    return c->last[PAL_CONTROL_ERROR].error.code;
}

static void a_role_is_what_the_ticket_says(void)
{
    mem_client a, b, c;
    begin(0);
    mem_connect(&a, transport, "", "");
    mem_enter(&a, "Mallory", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_ANY, false);
    join(&b, "Tim", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE);
    mem_pull(&a, 1000);
    CHECK_INT(a.last[PAL_CONTROL_HELLO].hello.you_role, PAL_WIRE_ROLE_VIEWER);
    CHECK_INT(a.last[PAL_CONTROL_HELLO].hello.you_tool, PAL_WIRE_TOOL_NONE);
    CHECK_TEXT(a.last[PAL_CONTROL_ERROR].error.text,
               "without a ticket you may only watch: use an address that the server has printed");
    CHECK_INT(b.last[PAL_CONTROL_HELLO].hello.you_role, PAL_WIRE_ROLE_TRAINEE);
    order(&a, "reset", "", ""), order(&a, "pause", "", ""), mem_text(&a, "{\"type\":\"take_tool\",\"tool\":0}");
    mem_pull(&a, 1000);
    CHECK_INT(a.n_text[PAL_CONTROL_ERROR], 4);
    mem_connect(&c, transport, "", "AQECAwQ"); /* what is no ticket of this server */
    CHECK_INT(pal_mem_code(c.peer), PAL_WIRE_CLOSE_POLICY);
    CHECK_TEXT(pal_mem_reason(c.peer), "this ticket is not one of this server");
    mem_end(&a), mem_end(&b), mem_end(&c);
    end();
}

static void an_instructor_gives_each_right_alone_and_all_see_who_did_what(void)
{
    static const struct {
        const char *verb, *target, *args, *right;
    } orders[] = {{"step", "", "", "steer"},
                  {"reset", "", "", "steer"},
                  {"material", "organ", "\"young_Pa\":4000", "material"},
                  {"component", "gravity", "\"part\":0,\"enabled\":0", "component"}};
    mem_client teacher, tim;
    char args[64];
    begin(0);
    join(&teacher, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    join(&tim, "Tim", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    snprintf(args, sizeof args, "\"member\":%d,\"enabled\":1", id_of(&tim));
    turn(&teacher, &tim);
    CHECK_TEXT(member(&teacher, &tim)->rights, "");
    for (size_t i = 0; i < sizeof orders / sizeof *orders; i++) {
        const int before = tim.n_text[PAL_CONTROL_ERROR];
        order(&tim, orders[i].verb, orders[i].target, orders[i].args);
        mem_pull(&tim, 1000);
        if (i != 1) CHECK_INT(tim.n_text[PAL_CONTROL_ERROR], before + 1); /* the right of the first is the second's */
        if (i != 1) CHECK_TEXT(error_code(&tim), "role");
        order(&teacher, "allow", orders[i].right, args);
        const int given = tim.n_text[PAL_CONTROL_ERROR];
        order(&tim, orders[i].verb, orders[i].target, orders[i].args);
        turn(&teacher, &tim);
        CHECK_INT(tim.n_text[PAL_CONTROL_ERROR], given);
    }
    CHECK_TEXT(member(&tim, &tim)->rights, "steer material component");
    order(&tim, "allow", "sculpt", args); /* rights are not the trainee's to give */
    mem_pull(&tim, 1000);
    CHECK_TEXT(error_code(&tim), "role");
    /* the newest orders are known to all, with the name; who comes later is told them too */
    const pal_wire_orders *known = &tim.last[PAL_CONTROL_ORDERS].orders;
    CHECK_INT(known->n_order, 2);
    CHECK_TEXT(known->order[0].verb, "allow");
    CHECK_TEXT(known->order[1].name, "Tim");
    CHECK_TEXT(known->order[1].verb, "component");
    CHECK_TEXT(known->order[1].target, "gravity");
    CHECK_TEXT(known->order[1].text, "part 0 enabled 0");
    mem_client late;
    join(&late, "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    turn(&late, NULL);
    CHECK_INT(late.last[PAL_CONTROL_ORDERS].orders.n_order, 9);
    CHECK(late.last[PAL_CONTROL_ORDERS].orders.order[0].age_s > 0.9);
    CHECK_TEXT(late.last[PAL_CONTROL_ORDERS].orders.order[0].verb, "allow");
    mem_end(&teacher), mem_end(&tim), mem_end(&late);
    end();
}

static void an_instructor_takes_gives_and_locks_tools(void)
{
    mem_client teacher, tim, bo;
    char args[64];
    begin(0);
    join(&teacher, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    join(&tim, "Tim", PAL_WIRE_ROLE_TRAINEE, 0);
    join(&bo, "Bo", PAL_WIRE_ROLE_TRAINEE, 1);
    snprintf(args, sizeof args, "\"tool\":0,\"member\":%d", id_of(&teacher));
    order(&teacher, "hand_over", "", args); /* taken over */
    turn(&teacher, &tim);
    CHECK_INT(member(&teacher, &teacher)->tool, 0);
    CHECK_INT(member(&teacher, &tim)->tool, PAL_WIRE_TOOL_NONE);
    CHECK_TEXT(error_code(&tim), "tool_handed_over");
    mem_text(&tim, "{\"type\":\"take_tool\",\"tool\":0}");
    mem_pull(&tim, 1000);
    CHECK_TEXT(error_code(&tim), "tool_taken");
    snprintf(args, sizeof args, "\"tool\":0,\"member\":%d", id_of(&tim));
    order(&teacher, "hand_over", "", args); /* and back */
    turn(&teacher, &tim);
    CHECK_INT(member(&teacher, &tim)->tool, 0);
    order(&teacher, "lock_tool", "", "\"tool\":0");
    turn(&teacher, &tim);
    CHECK_INT(member(&teacher, &tim)->tool, PAL_WIRE_TOOL_NONE);
    CHECK_INT(teacher.last[PAL_CONTROL_MEMBERS].members.n_locked, 1);
    mem_text(&tim, "{\"type\":\"take_tool\",\"tool\":-1}"), mem_text(&tim, "{\"type\":\"take_tool\",\"tool\":0}");
    mem_pull(&tim, 1000);
    CHECK_TEXT(error_code(&tim), "tool_locked");
    order(&teacher, "hand_over", "", args); /* the instructor may give what is locked */
    turn(&teacher, &tim);
    CHECK_INT(member(&teacher, &tim)->tool, 0);
    order(&teacher, "hand_over", "", "\"tool\":1,\"member\":0"); /* to nobody */
    turn(&teacher, &bo);
    CHECK_INT(member(&teacher, &bo)->tool, PAL_WIRE_TOOL_NONE);
    mem_end(&teacher), mem_end(&tim), mem_end(&bo);
    end();
}

static void an_instructor_mutes_removes_bans_and_locks(void)
{
    mem_client teacher, tim, back;
    char args[64];
    begin(0);
    join(&teacher, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    join(&tim, "Tim", PAL_WIRE_ROLE_TRAINEE, 0);
    snprintf(args, sizeof args, "\"member\":%d", id_of(&tim));
    order(&teacher, "allow", "", "\"enabled\":1");
    order(&teacher, "mute", "", args);
    turn(&teacher, &tim);
    CHECK(member(&teacher, &tim)->muted);
    CHECK_INT(member(&teacher, &tim)->tool, PAL_WIRE_TOOL_NONE);
    CHECK_TEXT(member(&teacher, &tim)->rights, "steer material component configure sculpt cut");
    order(&tim, "step", "", ""), mem_text(&tim, "{\"type\":\"take_tool\",\"tool\":0}");
    const int before = tim.n_text[PAL_CONTROL_ERROR];
    mem_pull(&tim, 1000);
    CHECK_INT(tim.n_text[PAL_CONTROL_ERROR], before + 2);
    CHECK_TEXT(error_code(&tim), "muted");
    order(&teacher, "remove", "", args);
    CHECK_INT(pal_mem_code(tim.peer), PAL_WIRE_CLOSE_REMOVED);
    CHECK_TEXT(pal_mem_reason(tim.peer), "Ada has removed you");
    mem_connect(&back, transport, "192.0.2.1", ticket[PAL_WIRE_ROLE_TRAINEE]);
    mem_enter(&back, "Tim", PAL_WIRE_ROLE_TRAINEE, 0, false);
    mem_pull(&back, 1000);
    snprintf(args, sizeof args, "\"member\":%d", id_of(&back));
    order(&teacher, "ban", "", args);
    CHECK_INT(pal_mem_code(back.peer), PAL_WIRE_CLOSE_REMOVED);
    mem_end(&back);
    mem_connect(&back, transport, "192.0.2.1", ticket[PAL_WIRE_ROLE_TRAINEE]);
    CHECK_INT(pal_mem_code(back.peer), PAL_WIRE_CLOSE_POLICY);
    mem_end(&back);
    order(&teacher, "lock_session", "", "");
    turn(&teacher, NULL);
    CHECK(teacher.last[PAL_CONTROL_MEMBERS].members.locked);
    join(&back, "Cy", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    CHECK_INT(pal_mem_code(back.peer), PAL_WIRE_CLOSE_FULL);
    CHECK_TEXT(pal_mem_reason(back.peer), "an instructor has locked the session");
    mem_end(&back);
    join(&back, "Bea", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    CHECK_INT(pal_mem_code(back.peer), 0);
    mem_end(&back), mem_end(&tim), mem_end(&teacher);
    end();
}

/* 600 connections that say nothing, from one address and from many, keep nobody out; nor do many members of one */
static void who_fills_places_keeps_nobody_out(void)
{
    static mem_client silent[600], full[40];
    mem_client honest, waiting, teacher;
    char address[32];
    begin(0);
    mem_connect(&waiting, transport, "192.0.2.9", ticket[PAL_WIRE_ROLE_TRAINEE]);
    for (int i = 0; i < 300; i++) mem_connect(&silent[i], transport, "192.0.2.1", "");
    /* those of another address that have not joined yet are still there */
    mem_enter(&waiting, "Grace", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY, false);
    CHECK_INT(pal_mem_code(waiting.peer), 0);
    int open = 0;
    for (int i = 0; i < 300; i++) open += pal_mem_code(silent[i].peer) == 0;
    CHECK_INT(open, PAL_UNJOINED_OF_ADDRESS);
    CHECK_INT(pal_mem_code(silent[0].peer), PAL_WIRE_CLOSE_FULL);
    for (int i = 300; i < 600; i++) {
        snprintf(address, sizeof address, "198.51.100.%d", i - 300);
        mem_connect(&silent[i], transport, address, "");
    }
    open = 0;
    for (int i = 0; i < 600; i++) open += pal_mem_code(silent[i].peer) == 0;
    CHECK_INT(open, PAL_UNJOINED_PLACES);
    mem_connect(&honest, transport, "192.0.2.7", ticket[PAL_WIRE_ROLE_TRAINEE]);
    mem_enter(&honest, "Ada", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY, false);
    mem_pull(&honest, 1000);
    CHECK_INT(honest.n_text[PAL_CONTROL_HELLO], 1);
    /* one address has so many members, and no more */
    int joined = 0;
    for (int i = 0; i < 40; i++) {
        mem_connect(&full[i], transport, "192.0.2.1", ticket[PAL_WIRE_ROLE_TRAINEE]);
        mem_enter(&full[i], "crowd", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE, false);
        joined += pal_mem_code(full[i].peer) == 0;
    }
    CHECK_INT(joined, PAL_ADDRESS_PLACES);
    mem_connect(&teacher, transport, "192.0.2.1", ticket[PAL_WIRE_ROLE_INSTRUCTOR]);
    mem_enter(&teacher, "teacher", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE, false);
    CHECK_INT(pal_mem_code(teacher.peer), 0);
    for (int i = 0; i < 600; i++) mem_end(&silent[i]);
    for (int i = 0; i < 40; i++) mem_end(&full[i]);
    mem_end(&honest), mem_end(&waiting), mem_end(&teacher);
    end();
}

static void places_are_kept_for_instructors(void)
{
    static mem_client crowd[16], teacher;
    begin(16);
    for (int i = 0; i < 16; i++) join(&crowd[i], "crowd", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE);
    for (int i = 0; i < 16; i++)
        CHECK_INT(pal_mem_code(crowd[i].peer), i < 16 - PAL_INSTRUCTOR_PLACES ? 0 : PAL_WIRE_CLOSE_FULL);
    join(&teacher, "teacher", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    CHECK_INT(pal_mem_code(teacher.peer), 0);
    for (int i = 0; i < 16; i++) mem_end(&crowd[i]);
    mem_end(&teacher);
    end();
}

/* does a page of the server hold this text? */
static bool page_has(const char *path, const char *text)
{
    pal_reply reply;
    pal_mem_get(transport, path, &reply);
    char *body = strndup((const char *)reply.body->bytes, reply.body->n_byte);
    const bool has = strstr(body, text) != NULL;
    free(body);
    pal_packet_drop(reply.body);
    return has;
}

static void viewers_and_members_take_no_place_of_each_other(void)
{
    static mem_client viewer[8], trainee[8];
    begin_with(8, 6);
    for (int i = 0; i < 7; i++) join(&viewer[i], "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    for (int i = 0; i < 7; i++) CHECK_INT(pal_mem_code(viewer[i].peer), i < 6 ? 0 : PAL_WIRE_CLOSE_FULL);
    /* of eight members two places are kept for instructors */
    for (int i = 0; i < 7; i++) join(&trainee[i], "Tim", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE);
    for (int i = 0; i < 7; i++) CHECK_INT(pal_mem_code(trainee[i].peer), i < 6 ? 0 : PAL_WIRE_CLOSE_FULL);
    turn(&trainee[0], &viewer[0]);
    CHECK_INT(trainee[0].last[PAL_CONTROL_STATUS].status.n_member, 6);
    CHECK_INT(trainee[0].last[PAL_CONTROL_STATUS].status.n_viewer, 6);
    CHECK_INT(trainee[0].last[PAL_CONTROL_MEMBERS].members.n_member, 12);
    CHECK(page_has("/sessions", "\"members\":6,\"viewers\":6,"));
    CHECK(page_has("/metrics", "palpate_clients{role=\"viewer\",transport=\"ws\"} 6\n"));
    CHECK(page_has("/metrics", "palpate_clients{role=\"trainee\",transport=\"ws\"} 6\n"));
    /* who leaves makes room for one of its kind */
    mem_end(&trainee[0]);
    join(&viewer[7], "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    CHECK_INT(pal_mem_code(viewer[7].peer), PAL_WIRE_CLOSE_FULL);
    mem_end(&viewer[7]), mem_end(&viewer[0]);
    join(&viewer[7], "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    CHECK_INT(pal_mem_code(viewer[7].peer), 0);
    for (int i = 0; i < 8; i++) mem_end(&viewer[i]), mem_end(&trainee[i]);
    end();
}

/* who watches and finds no place is sent to the relays; who would take part is not, and nobody into a locked session */
static void who_finds_no_place_to_watch_is_sent_to_relays(void)
{
    mem_client teacher, viewer[2], trainee[2];
    begin_server((pal_server_options){
        .max_clients = 2, .max_viewers = 1, .relays = "http://192.0.2.7:8092/,https://b.example/?session=small"});
    CHECK(page_has("/sessions", "\"relays\":[\"http://192.0.2.7:8092/\",\"https://b.example/?session=small\"]"));
    for (int i = 0; i < 2; i++) join(&viewer[i], "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    CHECK_INT(pal_mem_code(viewer[0].peer), 0);
    CHECK_INT(pal_mem_code(viewer[1].peer), PAL_WIRE_CLOSE_ELSEWHERE);
    CHECK_TEXT(pal_mem_reason(viewer[1].peer), "the server has no free place");
    join(&teacher, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    for (int i = 0; i < 2; i++) join(&trainee[i], "Tim", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE);
    CHECK_INT(pal_mem_code(trainee[1].peer), PAL_WIRE_CLOSE_FULL);
    mem_end(&viewer[0]), mem_end(&viewer[1]);
    order(&teacher, "lock_session", "", "\"enabled\":1");
    turn(&teacher, NULL);
    join(&viewer[0], "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    CHECK_INT(pal_mem_code(viewer[0].peer), PAL_WIRE_CLOSE_FULL);
    mem_end(&viewer[0]), mem_end(&teacher), mem_end(&trainee[0]), mem_end(&trainee[1]);
    end();
}

/* a relay is a viewer too: with a ticket of its own it comes back into a server that a crowd has filled meanwhile */
static void a_ticket_of_ones_own_finds_a_place_to_watch(void)
{
    static char path[] = "/tmp/palpate_members_keys_XXXXXX";
    static mem_client guest[PAL_VIEWING_TICKETS + 1];
    mem_client crowd[2];
    pal_ticket_keys keys;
    char text[PAL_TICKET_TEXT];
    int id = 0, fd = mkstemp(path);
    REQUIRE(fd >= 0 && !close(fd) && !unlink(path) && !pal_key_file_add(path, &id, NULL));
    REQUIRE(!pal_ticket_keys_read(path, &keys, NULL));
    const pal_ticket ticket_of_relay = {.role = PAL_WIRE_ROLE_VIEWER, .user = 7, .nonce = 1};
    CHECK(pal_ticket_put(&ticket_of_relay, &keys.key[0], text));
    begin_server((pal_server_options){.max_viewers = 1, .key_file = path});
    for (int i = 0; i < 2; i++) join(&crowd[i], "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    CHECK_INT(pal_mem_code(crowd[1].peer), PAL_WIRE_CLOSE_FULL);
    for (int i = 0; i <= PAL_VIEWING_TICKETS; i++) {
        mem_connect(&guest[i], transport, "192.0.2.7", text);
        mem_enter(&guest[i], "relay", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE, false);
        CHECK_INT(pal_mem_code(guest[i].peer), i < PAL_VIEWING_TICKETS ? 0 : PAL_WIRE_CLOSE_FULL);
    }
    for (int i = 0; i <= PAL_VIEWING_TICKETS; i++) mem_end(&guest[i]);
    mem_end(&crowd[0]), mem_end(&crowd[1]);
    end();
    unlink(path);
}

static void what_is_no_address_of_a_relay_is_refused(void)
{
    static const char *const wrong[] = {"relay:8092",       "javascript:alert(1)", "http://a/,ftp://b/",
                                        "http://",          "http:///x",           "http://a/<b>",
                                        "http://a/#ticket", "http://a/,,http://b/"};
    char many[512] = "";
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        CHECK_INT(pal_relay_list_check(wrong[i], "--relays", NULL), PAL_ERR_REFUSED);
    CHECK_INT(pal_relay_list_check(NULL, "--relays", NULL), PAL_ERR_OK);
    CHECK(pal_relay_list_json("") == NULL);
    for (int i = 0; i < PAL_RELAY_LIST_MAX; i++) strcat(many, "http://a:1/,");
    CHECK_INT(pal_relay_list_check(many, "--relays", NULL), PAL_ERR_OK); /* one comma at its end */
    strcat(many, "http://a:1/");
    CHECK_INT(pal_relay_list_check(many, "--relays", NULL), PAL_ERR_REFUSED);
}

/* more viewers than `members` names: everybody has an id and the list, and who may act is always on it */
static void a_crowd_of_viewers_leaves_the_members_listed(void)
{
    static mem_client viewer[100];
    mem_client teacher, tim;
    char args[64];
    begin(0);
    for (int i = 0; i < 100; i++) join(&viewer[i], "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    for (int i = 0; i < 100; i++) {
        CHECK_INT(pal_mem_code(viewer[i].peer), 0);
        CHECK(id_of(&viewer[i]) > PAL_MEMBER_ID_MAX);
        for (int k = 0; k < i; k++) CHECK(id_of(&viewer[i]) != id_of(&viewer[k]));
    }
    join(&tim, "Tim", PAL_WIRE_ROLE_TRAINEE, 0);
    join(&teacher, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    turn(&teacher, &viewer[99]);
    CHECK_INT(teacher.last[PAL_CONTROL_STATUS].status.n_viewer, 100);
    CHECK_INT(viewer[99].last[PAL_CONTROL_MEMBERS].members.n_member, PAL_WIRE_MEMBER_MAX);
    CHECK_INT(member(&viewer[99], &tim)->tool, 0);
    CHECK_INT(member(&viewer[99], &viewer[99])->id, 0);
    CHECK_INT(member(&viewer[99], &viewer[0])->id, id_of(&viewer[0]));
    /* an unlisted one that comes and goes is no news; it can be removed as any other */
    const int before = teacher.n_text[PAL_CONTROL_MEMBERS];
    snprintf(args, sizeof args, "\"member\":%d", id_of(&viewer[99]));
    order(&teacher, "remove", "", args);
    CHECK_INT(pal_mem_code(viewer[99].peer), PAL_WIRE_CLOSE_REMOVED);
    turn(&teacher, NULL);
    CHECK_INT(teacher.n_text[PAL_CONTROL_MEMBERS], before);
    snprintf(args, sizeof args, "\"tool\":0,\"member\":%d", id_of(&viewer[0]));
    order(&teacher, "hand_over", "", args);
    turn(&teacher, NULL);
    CHECK_TEXT(teacher.last[PAL_CONTROL_ERROR].error.text, "Eve is a viewer, who holds no tool");
    for (int i = 0; i < 100; i++) mem_end(&viewer[i]);
    mem_end(&teacher), mem_end(&tim);
    end();
}

/* of one address of another machine come at most a quarter of the viewers, so that one keeps nobody out */
static void viewers_of_one_address_keep_no_others_out(void)
{
    static mem_client crowd[60];
    mem_client other;
    int joined = 0;
    begin_with(0, 200);
    for (int i = 0; i < 60; i++) {
        mem_connect(&crowd[i], transport, "192.0.2.1", "");
        mem_enter(&crowd[i], "crowd", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE, false);
        joined += pal_mem_code(crowd[i].peer) == 0;
    }
    CHECK_INT(joined, 200 / PAL_VIEWING_ADDRESSES);
    mem_connect(&other, transport, "192.0.2.2", "");
    mem_enter(&other, "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE, false);
    CHECK_INT(pal_mem_code(other.peer), 0);
    for (int i = 0; i < 60; i++) mem_end(&crowd[i]);
    mem_end(&other);
    end();
}

/* one member takes and releases a tool as fast as it may: the others hear of it four times a second */
static void members_are_reported_four_times_a_second(void)
{
    mem_client busy, other;
    begin(0);
    join(&busy, "Tim", PAL_WIRE_ROLE_TRAINEE, 0);
    join(&other, "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    turn(&busy, &other);
    const int before = other.n_text[PAL_CONTROL_MEMBERS];
    for (int i = 0; i < 100; i++) {
        mem_text(&busy, i % 2 ? "{\"type\":\"take_tool\",\"tool\":0}" : "{\"type\":\"release_tool\"}");
        served_turn(100000000u, &busy, &other);
    }
    CHECK_INT(pal_mem_code(busy.peer), 0);
    CHECK_LE(other.n_text[PAL_CONTROL_MEMBERS] - before, 41);
    CHECK_LE(30, other.n_text[PAL_CONTROL_MEMBERS] - before);
    turn(&busy, &other);
    CHECK_INT(member(&other, &busy)->tool, 0); /* as it is now */
    /* commands have a rate of their own, which is no pose's */
    int n = 0;
    for (; n < 200 && !pal_mem_code(busy.peer); n++) mem_text(&busy, "{\"type\":\"release_tool\"}");
    CHECK_INT(pal_mem_code(busy.peer), PAL_WIRE_CLOSE_RATE);
    CHECK_INT(n, PAL_CONTROL_AT_ONCE + 1);
    mem_end(&busy), mem_end(&other);
    end();
}

int main(void)
{
    if (!small_scene_make(&organ, "small")) return 1;
    RUN(a_role_is_what_the_ticket_says);
    RUN(an_instructor_gives_each_right_alone_and_all_see_who_did_what);
    RUN(an_instructor_takes_gives_and_locks_tools);
    RUN(an_instructor_mutes_removes_bans_and_locks);
    RUN(who_fills_places_keeps_nobody_out);
    RUN(places_are_kept_for_instructors);
    RUN(viewers_and_members_take_no_place_of_each_other);
    RUN(who_finds_no_place_to_watch_is_sent_to_relays);
    RUN(a_ticket_of_ones_own_finds_a_place_to_watch);
    RUN(what_is_no_address_of_a_relay_is_refused);
    RUN(a_crowd_of_viewers_leaves_the_members_listed);
    RUN(viewers_of_one_address_keep_no_others_out);
    RUN(members_are_reported_four_times_a_second);
    pal_prepared_free(&organ.mesh);
    return check_report();
}
