// Nothing outlives its data: what a page says while its service hangs, its connection is cut, or its sources give nothing.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { browser, driven, opened, until } from "./browser.mjs";
import { AXES, between, serve } from "./service.mjs";

driven("what is shown and may be old", () => {
  let service, chromium, link, page;
  before(async () => {
    [service, chromium] = await Promise.all([serve(), browser()]);
    link = await between(service.port);
    page = await opened(chromium, link.url);
    page.expected = (text) => /Failed to load|ERR_|40\d/.test(text);
    await fine();
  });
  after(async () => {
    await chromium?.close();
    link?.cut();
    await service?.stop();
  });

  const doubt = (kind) => page.locator(`.doubt.${kind}`);
  const unknown = () => page.locator("section[aria-labelledby=now] li.unknown");
  const last = () => page.locator("header .muted").first().innerText();
  const fine = () => until("no doubt", async () => (await page.locator(".doubt").count()) === 0 && /^tick of/.test(await last()) && (await page.locator("li.yes, li.no").count()) > 0, 20);

  /** Nothing moves while there is a doubt: neither the last tick nor the last value of a curve. */
  async function stands(kind) {
    await doubt(kind).waitFor({ timeout: 5000 });
    assert.match(await doubt(kind).innerText(), /since (\S+ )?\d\d:\d\d:\d\d \(/);
    await until("all unknown", async () => (await unknown().count()) === AXES.length);
    assert.doesNotMatch(await page.locator("section[aria-labelledby=now]").innerText(), /may measure: (yes|no)/);
    const legend = () => page.locator(".legend").first().innerText();
    const [shown, values] = [await last(), await legend()];
    await new Promise((done) => setTimeout(done, 1500));
    assert.deepEqual([await last(), await legend()], [shown, values]);
    return shown;
  }

  test("a service that is stopped by a signal", async () => {
    process.kill(service.pid, "SIGSTOP");
    const began = Date.now();
    await doubt("no_tick").waitFor({ timeout: 3000 });
    assert.ok(Date.now() - began < 3000, "said within 3 s");
    await stands("no_tick");
    const at = async () => (await page.locator(".doubt.no_tick").innerText()).match(/\((\d+)/)?.[1];
    const first = await at();
    await until("it counts on", async () => Number(await at()) > Number(first), 5);
    process.kill(service.pid, "SIGCONT");
    await fine();
  });

  test("a connection that is cut", async () => {
    link.cut();
    const shown = await stands("lost");
    assert.match(await doubt("lost").innerText(), /No connection to the service since .*tried again/);
    await link.mend();
    await fine();
    assert.notEqual(await last(), shown);
  });

  test("a source that gives nothing", async () => {
    service.feeding = false;
    await stands("no_tick");
    assert.match(await doubt("no_tick").innerText(), /they came each 0\.1 s/);
    service.feeding = true;
    await fine();
  });

  test("a page that is opened while nothing comes", async () => {
    service.feeding = false;
    await doubt("no_tick").waitFor();
    const late = await opened(chromium, service.url);
    await late.locator(".doubt.no_tick").waitFor({ timeout: 8000 });
    assert.doesNotMatch(await late.locator("section[aria-labelledby=now]").innerText(), /may measure: (yes|no)/);
    service.feeding = true;
    await late.locator(".state.running").waitFor({ timeout: 8000 });
    await late.context().close();
  });

  test("a service that is killed, and started again", async () => {
    const at = Date.now() / 1000;
    await service.kill();
    await stands("lost");
    await service.start();
    await fine();
    const asked = page.waitForResponse((of) => of.url().includes("/v1/history?channel="));
    await page.reload();
    await fine();
    const { time_s } = await (await asked).json();
    assert.ok(time_s.some((time) => time < at - 5), "what was before the kill is remembered");
  });

  test("a service that is degraded", async () => {
    const other = await serve({ is_away: true });
    const late = await opened(chromium, other.url);
    await late.locator(".doubt.degraded").waitFor();
    assert.match(await late.locator(".doubt.degraded").innerText(), /degraded since \S+ .*not connected: other/);
    await until("ticks", async () => /^tick of/.test(await late.locator("header .muted").first().innerText()));
    assert.doesNotMatch(await late.locator("section[aria-labelledby=now]").innerText(), /may measure: (yes|no)/);
    assert.match(await late.title(), /degraded/);
    await late.context().close();
    await other.stop();
  });

  test("nobody else is asked", () => assert.deepEqual(page.wrong, []));
});
