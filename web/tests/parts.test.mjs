// Each part of the page, clicked and typed at a service that runs.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { browser, driven, opened, text_of, until } from "./browser.mjs";
import { AXES, graph, SCRIPT, serve } from "./service.mjs";

driven("the page of a service", () => {
  let service, chromium, page;
  before(async () => {
    [service, chromium] = await Promise.all([serve({ more: ` ${SCRIPT}` }), browser()]);
    page = await opened(chromium, service.url);
    await page.getByText("running", { exact: true }).waitFor();
  });
  after(async () => {
    await chromium?.close();
    await service?.stop();
  });

  const region = (name) => page.locator(`section[aria-labelledby=${name}]`);
  const status = async () => (await fetch(`${service.url}v1/status`)).json();
  /** An order from a page that shows another revision is refused. */
  const shows_what_runs = async () => (await region("swap").innerText()).includes(`${(await status()).revision.slice(0, 8)} runs`);

  test("the top has a sentence for each axis, and the state of each part", async () => {
    const axes = region("now").locator("li");
    await until("six axes", async () => (await axes.count()) === AXES.length);
    for (const [nth, axis] of AXES.entries()) assert.match(await axes.nth(nth).innerText(), new RegExp(`${axis} .*may measure: (yes|no|unknown)`, "s"));
    const parts = await region("parts").innerText();
    for (const word of [/1 source, all connected/, /ticks, one each 0\.1 s/, /records/, /revision [0-9a-f]{8}/, /fitted/]) assert.match(parts, word);
  });

  test("curves have what was before the page was opened, and go on", async () => {
    const legend = region("drift").locator(".legend").first();
    assert.match(await legend.innerText(), /measured.*predicted.*left/s);
    const value = legend.locator("b").first();
    const first = await value.innerText();
    await until("another value", async () => (await value.innerText()) !== first);
    const asked = () => page.evaluate(() => performance.getEntriesByType("resource").some((of) => of.name.includes("/v1/history?channel=")));
    await until("what was before, asked for", asked);
  });

  test("keys, buttons and drags move all curves, and back to what is live", async () => {
    const where = region("drift").locator(".where");
    await region("drift").getByRole("button", { name: "1 min", exact: true }).click();
    assert.match(await where.innerText(), /last 60 s, live/);
    const picture = page.getByRole("application", { name: /^Drift of/ }).first();
    await picture.focus();
    await page.keyboard.press("ArrowLeft");
    assert.match(await where.innerText(), / to /);
    await page.keyboard.press("End");
    assert.match(await where.innerText(), /live/);
    await page.keyboard.press("-");
    assert.match(await where.innerText(), /last 2 min|last 120 s/);
    const over = picture.locator(".u-over");
    const box = await over.boundingBox();
    await page.mouse.move(box.x + 0.3 * box.width, box.y + 40);
    await page.mouse.down();
    await page.mouse.move(box.x + 0.6 * box.width, box.y + 40, { steps: 5 });
    await page.mouse.up();
    assert.match(await where.innerText(), / to /);
    await over.dblclick();
    assert.match(await where.innerText(), /live/);
    await region("drift").getByRole("button", { name: "1 day" }).click();
    await until("a day", async () => /last 24 h, live/.test(await where.innerText()));
    await region("drift").getByRole("button", { name: "all", exact: true }).click();
    await until("six pictures", async () => (await region("drift").locator(".plot").count()) === AXES.length);
    await region("drift").getByRole("button", { name: "Z1", exact: true }).click();
    const entry = region("drift").locator(".entry").first();
    await entry.click();
    assert.equal(await entry.getAttribute("aria-pressed"), "false");
    await entry.click();
  });

  test("one finger moves curves, and two zoom", async () => {
    const tablet = await opened(chromium, service.url, { viewport: { width: 800, height: 1100 }, hasTouch: true });
    const where = tablet.locator("section[aria-labelledby=drift] .where");
    await tablet.getByRole("button", { name: "1 min" }).first().tap();
    const over = tablet.locator("section[aria-labelledby=drift] .u-over").first();
    const { x, y, width } = await over.boundingBox();
    const session = await tablet.context().newCDPSession(tablet);
    const touch = (type, ...shares) => session.send("Input.dispatchTouchEvent", { type, touchPoints: shares.map((share, id) => ({ x: x + share * width, y: y + 30, id })) });
    await touch("touchStart", 0.3);
    for (const share of [0.4, 0.5, 0.6]) await touch("touchMove", share);
    await touch("touchEnd");
    await until("an earlier stretch", async () => / to /.test(await where.innerText()));
    const span = async () => tablet.getByRole("application", { name: /^Drift of/ }).first().getAttribute("aria-label");
    const before = await span();
    await touch("touchStart", 0.4, 0.6);
    for (const by of [0.1, 0.2, 0.3]) await touch("touchMove", 0.4 - by, 0.6 + by);
    await touch("touchEnd");
    await until("a closer look", async () => (await span()) !== before);
    await tablet.context().close();
  });

  test("sensors have values, ages and what was left out", async () => {
    const rows = region("sensors").locator("tbody tr");
    assert.equal(await rows.count(), 18);
    await page.getByLabel("Find").fill("PLATE");
    assert.equal(await rows.count(), 2);
    assert.match(await rows.first().innerText(), /temperature\.plate1\s+2\d\.\d+\s+Cel\s+\d/);
    await page.getByLabel("Find").fill("");
    assert.match(await region("sources").innerText(), /logger\s+connected/);
  });

  test("nodes of the graph have what they give, and their ages", async () => {
    await page.locator("#graph").scrollIntoViewIfNeeded();
    const box = page.getByRole("button", { name: /^vote, auto_weighted/ });
    await box.waitFor();
    assert.match(await box.textContent(), /age \d/);
    await box.focus();
    await page.keyboard.press("Enter");
    const node = page.getByRole("group", { name: "Node vote" });
    await node.waitFor();
    assert.match(await node.innerText(), /vote\.Z1\s+−?\d.*vote:weights\.Z1/s);
    await node.getByRole("button", { name: "Close" }).click();
    assert.equal(await node.count(), 0);
  });

  test("votes and novelty are drawn", async () => {
    await page.locator("#votes").scrollIntoViewIfNeeded();
    await until("weights", async () => /thermal\s+[01]\.?\d*\s+motion\s+[01]/.test(await region("votes").innerText()));
    assert.match(await region("votes").innerText(), /Novelty/);
  });

  test("a graph with mistakes is refused with their places, and nothing of it runs as script", async () => {
    const bad = graph().replace('"ar"', `"ar${SCRIPT}"`).replace('windows = ["3s"', 'windoms = ["3s"');
    await page.getByLabel("Graph or model").fill(bad);
    await page.getByRole("button", { name: "Stage this graph" }).click();
    const dialog = page.getByRole("dialog");
    await dialog.getByLabel("Token").fill("wrong");
    page.expected = (text) => /401|422/.test(text);
    await page.keyboard.press("Enter");
    await dialog.getByText("refused").waitFor();
    await dialog.getByLabel("Token").fill(service.token);
    await page.keyboard.press("Enter");
    await region("swap").getByText(/the graph has 2 mistakes/).waitFor();
    const words = await region("swap").locator(".refused").innerText();
    assert.match(words, /A006/);
    assert.match(words, /\^\^\^\^\^\^\^/);
    assert.ok(words.includes(SCRIPT), "the text of the graph is shown as it is");
    await region("swap").locator(".place").first().click();
    const at = await page.getByLabel("Graph or model").evaluate((field) => field.value.slice(field.selectionStart, field.selectionStart + 7));
    assert.equal(at, "windoms");
  });

  test("a model is staged, compared in the shadow, let take over, and taken back", async () => {
    const before = (await status()).revision;
    const file = join(service.folder, "upload.json");
    writeFileSync(file, service.other);
    await page.locator("input[type=file]").setInputFiles(file);
    await page.getByRole("button", { name: "Stage this model" }).click();
    await region("swap").getByText(/Done: [0-9a-f]{8} is staged/).waitFor();
    await until("what becomes of each node", async () => /carried: \d+/.test(await region("swap").innerText()));
    await page.getByLabel("Compare for").fill("10s");
    await page.getByRole("button", { name: "Compare in the shadow" }).click();
    await until("both errors, drawn", async () => (await region("swap").locator("svg.errors polyline").count()) >= 2, 25);
    assert.match(await region("swap").innerText(), /predicted\.X1/);
    await page.getByRole("button", { name: "Commit" }).click();
    await page.getByRole("dialog").getByRole("button", { name: "Commit" }).click();
    await until("the other revision", async () => (await status()).revision !== before);
    await until("its revision, shown", shows_what_runs);
    await page.getByRole("button", { name: "Roll back" }).click();
    await page.getByRole("dialog").getByRole("button", { name: "Cancel" }).click();
    assert.notEqual((await status()).revision, before);
    await page.getByRole("button", { name: "Roll back" }).click();
    await page.getByRole("dialog").getByRole("button", { name: "Roll back" }).click();
    await until("what ran before", async () => (await status()).revision === before);
    await until("its revision, shown again", shows_what_runs);
    await until("what happened", async () => /took over|takes over/.test(await region("events").innerText()));
  });

  test("learning is frozen, and thawed", async () => {
    await page.getByRole("button", { name: "Freeze learning" }).click();
    await until("frozen", async () => (await status()).frozen);
    await page.getByRole("button", { name: "Thaw learning" }).click();
    await until("thawed", async () => !(await status()).frozen);
  });

  test("alarms are shown and acknowledged, where the service has them", async (of) => {
    if ((await fetch(`${service.url}v1/alarms`)).status === 404) return of.skip("this program has no alarms");
    await region("alarms").getByText("raised", { exact: true }).waitFor();
    assert.ok((await region("alarms").innerText()).includes(SCRIPT));
    await region("alarms").getByRole("button", { name: "Acknowledge warm" }).click();
    return until("acknowledged", async () => /acknowledged/.test(await region("alarms").innerText()));
  });

  test("a prediction is taken apart, where the service can", async (of) => {
    const answer = await fetch(`${service.url}v1/contributions?output=predicted.X1`);
    if (answer.status === 404) return of.skip("this program has no contributions");
    await page.locator("#parts-of").waitFor();
    return until("sensors", async () => /plate1/.test(await region("parts-of").innerText()));
  });

  test("the token is kept for this tab alone", async () => {
    const kept = await page.evaluate(() => [localStorage.length, document.cookie, location.href, Object.keys(sessionStorage).length]);
    assert.deepEqual(kept, [0, "", service.url, 1]);
    await page.getByRole("button", { name: "Forget the token" }).click();
    assert.equal(await page.evaluate(() => sessionStorage.length), 0);
  });

  test("names are texts, whatever stands in them, nobody else is asked, and nothing is complained of", async () => {
    assert.ok((await text_of(page)).includes(`die-tester ${SCRIPT}`));
    assert.equal(await page.evaluate(() => window.hurt), undefined);
    assert.equal(await page.locator("img").count(), 0);
    assert.deepEqual(page.wrong, []);
  });
});
