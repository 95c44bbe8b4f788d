"""Start page with a slow network: what the user did last is what the page and the service have."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.app.browser import Held, needs_browser, opened, wait_until_settled
from tests.app.pretended import FAMILY, HELD, release
from tests.app.service import Caller, Server, empty, run_text

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page
from tests.app.start_page import drop, only_fit, press, roles, roles_before_and_after_a_reload

pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

pytestmark = needs_browser


@pytest.fixture
def server(open_server: Server) -> Server:
    """Service without keys."""
    return open_server


@pytest.fixture
def caller(server: Server) -> Iterator[Caller]:
    """Script, with four runs of two motors and nothing else in the service."""
    empty(server)
    with Caller(server) as made:
        for seed, motor in enumerate(("other", "servo", "servo", "servo")):
            made.upload(run_text(seed), name=f"run{seed}.csv", motor=motor)
        yield made


@pytest.fixture
def page(chromium: Browser, server: Server, caller: Caller) -> Iterator[Page]:
    """Start page with the three runs of the servo."""
    with opened(chromium, server.url) as shown:
        yield shown


def test_motor_typed_while_a_file_is_read_is_that_of_the_file(
    page: Page, caller: Caller, tmp_path: Path
) -> None:
    """The file was sent without a motor; the user types it while it is read."""
    with Held(page, "**/pending") as files:
        drop(page, tmp_path, 10)
        files.wait()
        page.locator("#motor").press_sequentially("drive")
        page.keyboard.press("Tab")
        page.wait_for_timeout(300)
    page.click("text=Add 1 run")
    page.locator("#runs", has_text="new10.csv").wait_for()

    assert page.get_by_label("Motor of new10.csv").input_value() == "drive"


def test_plots_that_load_while_their_file_is_added_are_given_up(page: Page, tmp_path: Path) -> None:
    """The file is a run then, and the browser would report that its samples are missing."""
    reported: list[str] = []
    page.on("console", lambda message: reported.append(message.text))
    with Held(page, "**/samples", method="GET") as loads:
        drop(page, tmp_path, 11)
        loads.wait()
        page.click("text=Add 1 run")
        page.locator("#runs", has_text="new11.csv").wait_for()
        loads.release()
        page.wait_for_timeout(500)

    assert reported == []


def test_two_roles_chosen_one_after_the_other_both_count(page: Page) -> None:
    """The answer to the first choice does not take back the second one."""
    chosen = {"run1.csv": "", "run2.csv": "validation", "run3.csv": "training"}
    with Held(page, "**/choice?*", is_answered=True) as answers:
        page.get_by_label("Role of run1.csv").select_option("")
        answers.wait()
        page.get_by_label("Role of run2.csv").select_option("validation")
        page.get_by_label("Role of run3.csv").select_option("training")
        page.wait_for_timeout(300)
        answers.release()
    wait_until_settled(page)

    assert roles_before_and_after_a_reload(page) == (chosen, chosen)


def test_role_chosen_during_a_gesture_counts(page: Page) -> None:
    """All runs train except the one that the user then leaves out."""
    chosen = {"run1.csv": "training", "run2.csv": "", "run3.csv": "training"}
    with Held(page, "**/choice?*") as requests:
        page.click("text=All training")
        requests.wait()
        page.get_by_label("Role of run2.csv").select_option("")
        page.wait_for_timeout(300)
        requests.release()
    wait_until_settled(page)

    assert roles_before_and_after_a_reload(page) == (chosen, chosen)


def test_gesture_repeated_after_a_role_counts_again(page: Page) -> None:
    """The second press of the button comes before the answer to the first."""
    chosen = dict.fromkeys(("run1.csv", "run2.csv", "run3.csv"), "training")
    with Held(page, "**/choice?*") as requests:
        page.click("text=All training")
        requests.wait()
        page.get_by_label("Role of run2.csv").select_option("")
        page.click("text=All training")
        page.wait_for_timeout(300)
        requests.release()
    wait_until_settled(page)

    assert roles(page) == chosen


def test_fit_started_after_a_gesture_has_its_roles(page: Page, caller: Caller) -> None:
    """The proposal sets one run apart; the fit trains with all three."""
    with Held(page, "**/choice?*") as requests:
        page.click("text=All training")
        requests.wait()
        page.click("text=Start fit")
        page.wait_for_timeout(300)
        requests.release()
    fit = only_fit(page, caller)

    assert fit["training"] == {"run1.csv", "run2.csv", "run3.csv"}


def test_fit_started_after_a_change_of_the_motor_has_the_new_motor(
    page: Page, caller: Caller
) -> None:
    """The motor is typed and the button pressed without a pause."""
    page.select_option("#choice-motor", "other")
    page.locator("#runs tr", has_text="run0.csv").wait_for()
    with Held(page, "**/runs/*/motor*") as requests:
        page.get_by_label("Role of run0.csv").select_option("training")
        page.fill("#runs .motor input", "drive")
        page.click("text=Start fit")
        requests.wait()
        page.wait_for_timeout(300)
        requests.release()
    fit = only_fit(page, caller)

    assert (fit["motor"], fit["training"]) == ("drive", {"run0.csv"})


def test_fit_is_not_started_if_the_change_before_it_fails(page: Page, caller: Caller) -> None:
    """The page says that the service does not respond, also after a later change has succeeded."""
    page.route("**/runs/*/motor*", lambda route: route.abort())
    with Held(page, "**/choice?*") as requests:
        page.click("text=None")
        requests.wait()
        page.get_by_label("Motor of run1.csv").fill("drive")
        page.get_by_label("Role of run2.csv").select_option("training")
        page.click("text=Start fit")
        page.wait_for_timeout(300)
        requests.release()
    page.locator("#problem", has_text="does not respond").wait_for()
    wait_until_settled(page)

    assert page.locator("#problem .notice").is_visible()
    assert page.is_enabled("text=Start fit")
    assert list(caller.client.fits()) == []


def test_second_press_while_the_page_of_a_fit_is_loaded_starts_no_fit(
    page: Page, caller: Caller
) -> None:
    """The fit is started, and its page takes its time."""
    page.wait_for_selector("#prospects >> text=identif")
    with Held(page, "**/fits/fit_*", "GET") as pages:
        page.hover("text=Start fit")
        press(page)
        pages.wait()
        press(page)
        page.wait_for_timeout(500)

    assert len(list(caller.client.fits())) == 1


def test_fit_that_ends_while_it_is_cancelled_remains(
    page: Page, server: Server, caller: Caller
) -> None:
    """The page says Cancel; the request reaches the service after the end of the fit."""
    run = next(iter(caller.client.runs())).id
    fit = caller.begin(run, seed=HELD)["id"]
    page.reload()
    with Held(page, f"**/fits/{fit}*", "DELETE") as requests:
        page.click(f"#end-{fit}")
        requests.wait()
        release(server.data_dir, fit)
        caller.wait(fit)
    page.locator("#work >> text=Report").wait_for()

    assert caller.fit(fit)["status"] == "succeeded"


def test_pages_of_fits_leave_connections_to_others(page: Page, caller: Caller) -> None:
    """A browser has six connections to a service; seven pages watch a fit, and an eighth opens."""
    fit = caller.begin(next(iter(caller.client.runs())).id, seed=FAMILY)["id"]
    pages = [page.context.new_page() for _ in range(7)]
    for one in pages:
        one.goto(f"{page.url}fits/{fit}")
        one.wait_for_selector(".state.running")
    last = page.context.new_page()
    last.goto(f"{page.url}compare")
    problems = [one.inner_text("#problem") for one in pages]
    caller.http.delete(f"/fits/{fit}")
    for one in pages:
        one.wait_for_selector(".state.cancelled")

    assert problems == 7 * [""]


def test_text_typed_while_another_change_is_answered_remains(page: Page, caller: Caller) -> None:
    """Two motors are renamed one after the other."""
    first, second = (page.get_by_label(f"Motor of run{number}.csv") for number in (3, 2))
    with Held(page, "**/runs/*/motor*", is_answered=True) as answers:
        first.fill("servo 3")
        second.click()
        answers.wait()
        page.keyboard.press("End")
        page.keyboard.type(" tw")
        answers.release()
        page.keyboard.type("o")
        page.keyboard.press("Tab")
        answers.wait()
    wait_until_settled(page)
    motors = {run.content["file"]: run.content["motor"] for run in caller.client.runs()}

    assert motors == {
        "run0.csv": "other",
        "run1.csv": "servo",
        "run2.csv": "servo two",
        "run3.csv": "servo 3",
    }
    page.locator("#runs tr").nth(1).wait_for(state="detached")


def test_enter_in_the_table_of_runs_starts_no_fit(page: Page, caller: Caller) -> None:
    """Enter applies the pattern, and stores the motor."""
    page.fill("#choice-pattern", "run2")
    page.press("#choice-pattern", "Enter")
    page.locator("#chosen", has_text=re.compile("^2 training and 1 validation")).wait_for()
    page.get_by_label("Motor of run1.csv").fill("drive")
    page.get_by_label("Motor of run1.csv").press("Enter")
    page.locator("#runs tr").nth(2).wait_for(state="detached")
    wait_until_settled(page)

    assert roles(page) == {"run2.csv": "validation", "run3.csv": "training"}
    assert list(caller.client.fits()) == []


def test_double_click_discards_one_file(page: Page, tmp_path: Path) -> None:
    """The first click is answered before the second one, which meets the button of another file."""
    drop(page, tmp_path, 20, 21, 22)
    page.locator("#pending-confirm[data-new='3']").wait_for()
    page.get_by_label("Discard new20.csv").hover()
    press(page)
    page.locator("article").nth(2).wait_for(state="detached")
    page.get_by_label("Discard new21.csv").hover()
    press(page, click=2)
    page.wait_for_timeout(300)
    wait_until_settled(page)

    assert page.locator("article").count() == 2


def test_correction_and_discarding_of_another_file_both_count(page: Page, tmp_path: Path) -> None:
    """The list is shown anew while the correction is on its way, and again after it."""
    drop(page, tmp_path, 30, 31)
    page.locator("#pending-confirm[data-new='2']").wait_for()
    sign = page.locator("article", has_text="new30.csv").get_by_label("Sign of current")
    with Held(page, "**/pending/*/mapping") as corrections:
        sign.select_option("-")
        corrections.wait()
        page.get_by_label("Discard new31.csv").click()
        page.wait_for_timeout(300)
        corrections.release()
    page.locator("article").nth(1).wait_for(state="detached")
    wait_until_settled(page)
    before = sign.input_value()
    page.reload()

    assert before == "-"
    assert sign.input_value() == "-"


def test_press_of_a_button_counts_though_an_answer_comes(page: Page, tmp_path: Path) -> None:
    """A person holds the mouse down for longer than the service needs to store the motor."""
    drop(page, tmp_path, 40)
    page.locator("#pending-confirm[data-new='1']").wait_for()
    page.locator("#motor").press_sequentially("motor 40")
    with page.expect_response(re.compile("/pending/labels")):
        page.locator("#pending-confirm").hover()
        page.mouse.down()
    wait_until_settled(page)
    page.mouse.up()

    page.locator("#runs", has_text="new40.csv").wait_for()
    assert page.get_by_label("Motor of new40.csv").input_value() == "motor 40"


def test_table_is_that_of_the_selected_motor_after_back(page: Page) -> None:
    """The browser restores no selection to which the table does not belong."""
    page.select_option("#choice-motor", "other")
    page.locator("#runs tr", has_text="run0.csv").wait_for()
    page.click("nav >> text=Compare")
    page.go_back()
    page.locator("#runs tr").first.wait_for()

    shown = page.input_value("#choice-motor")
    motors = {field.input_value() for field in page.locator("#runs .motor input").all()}
    assert motors == {shown}
