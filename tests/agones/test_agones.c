/* The Agones client against a fake sidecar: what it says, when, and what it makes of answers that fail. Nothing here
 * waits for a time: a test waits for the next requests. */
#include "server/agones/agones.h"

#include "server/agones/sidecar.h"
#include "tests/agones/fake_sidecar.h"
#include "tests/check.h"

#include <sys/eventfd.h>

enum { TURN_MS = 10 };
static int from; /* requests before are not waited for */
static fake_sidecar fake;
static pal_agones *agones;
static pthread_mutex_t server_lock = PTHREAD_MUTEX_INITIALIZER;
static pal_agones_server server; /* as the client sees it */

static void look(void *user, pal_agones_server *out)
{
    (void)user;
    pthread_mutex_lock(&server_lock);
    *out = server;
    pthread_mutex_unlock(&server_lock);
}

static void mark(void)
{
    pthread_mutex_lock(&fake.lock);
    from = fake.n;
    pthread_mutex_unlock(&fake.lock);
}

static void set_server(bool alive, int n_session, int n_client)
{
    mark();
    pthread_mutex_lock(&server_lock);
    server = (pal_agones_server){alive, n_session, n_client};
    pthread_mutex_unlock(&server_lock);
}

static void begin(double empty_s)
{
    set_server(true, 1, 0);
    REQUIRE(!pal_agones_start(
        &(pal_agones_options){.port = fake.port, .look = look, .turn_ms = TURN_MS, .empty_s = empty_s}, &agones));
}

static void end(void)
{
    pal_agones_stop(agones);
    fake_close(&fake);
}

/* until this request has come n times since the mark */
static void until(const char *request, int n)
{
    pthread_mutex_lock(&fake.lock);
    while (fake.n < FAKE_REQUESTS && fake_count(&fake, request, from) < n) pthread_cond_wait(&fake.changed, &fake.lock);
    CHECK(fake_count(&fake, request, from) >= n);
    pthread_mutex_unlock(&fake.lock);
}

/* two whole turns: what is known now has been sent */
static void two_turns(void)
{
    mark();
    until("GET /gameserver ", 3);
}

static int count(const char *request)
{
    pthread_mutex_lock(&fake.lock);
    const int n = fake_count(&fake, request, 0);
    pthread_mutex_unlock(&fake.lock);
    return n;
}

static void check_state(const char *wanted)
{
    pthread_mutex_lock(&fake.lock);
    CHECK_TEXT(fake.state, wanted);
    pthread_mutex_unlock(&fake.lock);
}

static void it_begins_before_the_sidecar(void)
{
    REQUIRE(fake_init(&fake, 0));
    begin(1e6);
    REQUIRE(fake_listen(&fake));
    until("POST /health {}", 3);
    two_turns();
    check_state("Ready");
    CHECK_INT(count("POST /ready {}"), 1);
    CHECK_INT(count("POST /allocate {}"), 0);
    CHECK_INT(count("POST /shutdown {}"), 0);
    end();
}

static void what_changes_is_sent_once(void)
{
    REQUIRE(fake_init(&fake, 0) && fake_listen(&fake));
    fake.has_counters = true;
    begin(1e6);
    two_turns();
    set_server(true, 3, 2);
    until("PUT /metadata/label {\"key\":\"clients\",\"value\":\"2\"}", 1);
    two_turns();
    check_state("Allocated");
    CHECK_TEXT(fake.sessions, "3");
    CHECK_TEXT(fake.clients, "2");
    CHECK_TEXT(fake.counter, "3");
    CHECK_INT(count("POST /allocate {}"), 1);
    CHECK_INT(count("PUT /metadata/label {\"key\":\"sessions\",\"value\":\"3\"}"), 1);
    CHECK_INT(count("PATCH /v1beta1/counters/sessions {\"count\":\"3\"}"), 1);
    end();
}

static void a_fleet_without_counters_is_asked_once(void)
{
    REQUIRE(fake_init(&fake, 0) && fake_listen(&fake));
    begin(1e6);
    two_turns();
    set_server(true, 2, 0);
    two_turns();
    CHECK_INT(count("PATCH /v1beta1/counters/sessions {\"count\":\"1\"}"), 1);
    CHECK_INT(count("PATCH /v1beta1/counters/sessions {\"count\":\"2\"}"), 0);
    end();
}

static void a_simulation_that_stalls_gives_no_health(void)
{
    REQUIRE(fake_init(&fake, 0) && fake_listen(&fake));
    begin(1e6);
    until("POST /health {}", 2);
    set_server(false, 1, 0);
    two_turns(); /* one may be under way */
    const int n = count("POST /health {}");
    two_turns();
    CHECK_INT(count("POST /health {}"), n);
    set_server(true, 1, 0);
    until("POST /health {}", 1);
    end();
}

static void an_allocated_server_without_anybody_ends(void)
{
    REQUIRE(fake_init(&fake, 0) && fake_listen(&fake));
    begin(1e-9);
    two_turns(); /* a server that is ready may wait as long as it likes */
    CHECK_INT(count("POST /shutdown {}"), 0);
    set_server(true, 1, 1);
    until("POST /allocate {}", 1);
    two_turns();
    CHECK_INT(count("POST /shutdown {}"), 0);
    set_server(true, 1, 0);
    until("POST /shutdown {}", 1);
    two_turns();
    check_state("Shutdown");
    CHECK_INT(count("POST /shutdown {}"), 1);
    CHECK_INT(count("POST /ready {}"), 1);
    end();
}

static void one_that_was_started_again_stays_allocated(void)
{
    REQUIRE(fake_init(&fake, 0));
    snprintf(fake.state, sizeof fake.state, "Allocated");
    REQUIRE(fake_listen(&fake));
    begin(1e6);
    two_turns();
    check_state("Allocated");
    CHECK_INT(count("POST /ready {}"), 0);
    end();
}

static void lost_connections_cost_a_turn_each(void)
{
    REQUIRE(fake_init(&fake, 0) && fake_listen(&fake));
    begin(1e6);
    until("POST /health {}", 1);
    pthread_mutex_lock(&fake.lock);
    fake.n_drop = 5;
    pthread_mutex_unlock(&fake.lock);
    set_server(true, 1, 1);
    until("POST /health {}", 2);
    two_turns();
    check_state("Allocated");
    pthread_mutex_lock(&fake.lock);
    CHECK_INT(fake.n_drop, 0);
    CHECK_TEXT(fake.clients, "1");
    snprintf(fake.state, sizeof fake.state, "Scheduled"); /* and another sidecar */
    from = fake.n;
    pthread_mutex_unlock(&fake.lock);
    until("POST /ready {}", 1);
    end();
}

static void answers_are_those_of_the_sidecar(void)
{
    static pal_sidecar_answer answer;
    static const struct {
        const char *method, *path, *body;
        int status;
        const char *has;
    } is[] = {{"POST", "/health", "{}", 200, "{}"},       {"POST", "/health", NULL, 400, "\"details\""},
              {"POST", "/ready", NULL, 200, "{}"},        {"POST", "/ready", "x", 400, "\"code\""},
              {"GET", "/health", NULL, 501, "not"},       {"GET", "/nothing", NULL, 404, "\"code\""},
              {"GET", "/gameserver", NULL, 200, "Ready"}, {"PUT", "/metadata/label", "{\"key\":1}", 400, "proto"}};
    const int stop_fd = eventfd(0, EFD_CLOEXEC);
    REQUIRE(fake_init(&fake, 0) && fake_listen(&fake));
    for (size_t k = 0; k < sizeof is / sizeof *is; k++) {
        CHECK_INT(pal_sidecar_call(fake.port, stop_fd, is[k].method, is[k].path, is[k].body, &answer), PAL_ERR_OK);
        CHECK_INT(answer.status, is[k].status);
        CHECK(strcasestr(answer.body, is[k].has));
        CHECK_INT(strlen(answer.body), answer.n_body);
    }
    pthread_mutex_lock(&fake.lock);
    fake.n_drop = 8;
    pthread_mutex_unlock(&fake.lock);
    for (int k = 0; k < 8; k++) /* of both kinds */
        CHECK_INT(pal_sidecar_call(fake.port, stop_fd, "GET", "/gameserver", NULL, &answer), PAL_ERR_IO);
    fake_close(&fake);
    CHECK_INT(pal_sidecar_call(fake.port, stop_fd, "GET", "/gameserver", NULL, &answer), PAL_ERR_IO);
    eventfd_write(stop_fd, 1);
    REQUIRE(fake_init(&fake, 0)); /* a sidecar that accepts and never answers does not hold up the end */
    REQUIRE(!listen(fake.fd, 1));
    CHECK_INT(pal_sidecar_call(fake.port, stop_fd, "GET", "/gameserver", NULL, &answer), PAL_ERR_IO);
    fake_close(&fake);
    close(stop_fd);
}

static void the_environment_has_the_port(void)
{
    pal_diagnostic diag = {""};
    int port = -1;
    unsetenv("AGONES_SDK_HTTP_PORT");
    CHECK(!pal_agones_port(&diag, &port) && port == 0);
    setenv("AGONES_SDK_HTTP_PORT", "9358", true);
    CHECK(!pal_agones_port(&diag, &port) && port == 9358);
    setenv("AGONES_SDK_HTTP_PORT", "65536", true);
    CHECK_INT(pal_agones_port(&diag, &port), PAL_ERR_REFUSED);
    setenv("AGONES_SDK_HTTP_PORT", "9358x", true);
    CHECK_INT(pal_agones_port(&diag, &port), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "AGONES_SDK_HTTP_PORT=9358x"));
}

int main(void)
{
    RUN(it_begins_before_the_sidecar);
    RUN(what_changes_is_sent_once);
    RUN(a_fleet_without_counters_is_asked_once);
    RUN(a_simulation_that_stalls_gives_no_health);
    RUN(an_allocated_server_without_anybody_ends);
    RUN(one_that_was_started_again_stays_allocated);
    RUN(lost_connections_cost_a_turn_each);
    RUN(answers_are_those_of_the_sidecar);
    RUN(the_environment_has_the_port);
    return check_report();
}
