// What a page does where it is refused: without a token, with the wrong one, while there is no room, and of another graph than it shows.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browser, bundle, driven, opened, until } from "./browser.mjs";
import { serve } from "./service.mjs";

driven("where a page is refused", () => {
  let service, chromium;
  before(async () => {
    [service, chromium] = await Promise.all([serve(), browser()]);
  });
  after(async () => {
    await chromium?.close();
    await service?.stop();
  });

  /** A page whose requests pass `door` first. */
  async function through(door) {
    const page = await opened(chromium, "about:blank");
    page.expected = () => true;
    await bundle(page, service.url);
    await page.route(`${service.url}v1/**`, door);
    await page.goto(service.url);
    return page;
  }

  const json = (status, error, headers = {}) => ({ status, contentType: "application/json", headers, body: JSON.stringify({ error }) });
  const status = async () => (await fetch(`${service.url}v1/status`)).json();

  test("a page that may not look asks for a token once, and for nothing else until it has one", async () => {
    let [refused, taken] = [0, 0];
    const page = await through((route) => {
      if (route.request().headers().authorization === "Bearer look") return (taken += 1), route.continue();
      return (refused += 1), route.fulfill(json(401, "a token is needed"));
    });
    const dialog = page.getByRole("dialog");
    await dialog.waitFor();
    await new Promise((done) => setTimeout(done, 2500));
    assert.equal(refused, 1);
    await page.keyboard.press("Escape");
    await page.getByText("Nothing is shown without a token").waitFor();
    await page.getByRole("button", { name: "Type it" }).click();
    await dialog.getByLabel("Token").fill("look");
    await page.keyboard.press("Enter");
    await page.getByText(/^tick of/).waitFor();
    assert.ok(taken > 3 && refused === 1, `${taken} taken, ${refused} refused`);
    assert.ok(!page.url().includes("look"));
    await page.context().close();
  });

  test("over TLS a page looks with one token, and orders with the other", async (of) => {
    if (!service.secure) return of.skip("this program was built without TLS");
    const page = await opened(chromium, service.secure, { ignoreHTTPSErrors: true, expected: (text) => /40[134]/.test(text) });
    const dialog = page.getByRole("dialog");
    const type = async (name) => {
      await dialog.getByLabel("Token").fill(readFileSync(join(service.folder, "state", name), "utf8").trim());
      await page.keyboard.press("Enter");
    };
    await dialog.waitFor();
    await type("token-read");
    await page.getByText(/^tick of/).waitFor();
    await page.getByRole("button", { name: "Freeze learning" }).click();
    await dialog.getByText(/for looking/).waitFor();
    await type("token");
    await until("frozen", async () => (await status()).frozen);
    await page.getByRole("button", { name: "Thaw learning" }).click();
    await until("thawed", async () => !(await status()).frozen);
    assert.deepEqual(page.wrong, []);
    return page.context().close();
  });

  test("while there is no room the page says so, and tries again when it is told to", async () => {
    const tries = [];
    const page = await through((route) => {
      if (!route.request().url().includes("/events") || tries.length >= 2) return route.continue();
      tries.push(Date.now());
      return route.fulfill(json(503, "all streams are taken", { "Retry-After": "2" }));
    });
    await page.getByText(/all streams are taken; tried again in/).waitFor();
    await page.getByText(/^tick of/).waitFor({ timeout: 8000 });
    assert.ok(tries[1] - tries[0] >= 1900, `${tries[1] - tries[0]} ms`);
    await until("no doubt", async () => (await page.locator(".doubt").count()) === 0);
    await page.context().close();
  });

  test("an order for another graph than the one that runs is refused, and the page says so", async () => {
    const named = [];
    const page = await through((route) => {
      const headers = route.request().headers();
      if (route.request().method() !== "POST") return route.continue();
      named.push(headers["if-match"]);
      return route.continue({ headers: { ...headers, "if-match": '"0000"' } });
    });
    await page.getByRole("button", { name: "Freeze learning" }).click();
    await page.getByRole("dialog").getByLabel("Token").fill(service.token);
    await page.keyboard.press("Enter");
    await page.getByText(/Not now: /).waitFor();
    const { frozen, revision } = await status();
    assert.deepEqual([frozen, named], [false, [`"${revision}"`]]);
    await page.context().close();
  });

  test("an order is given once there is room", async () => {
    let tries = 0;
    const page = await through((route) => {
      if (route.request().method() !== "POST" || (tries += 1) > 1) return route.continue();
      return route.fulfill(json(503, "too many requests", { "Retry-After": "1" }));
    });
    await page.getByRole("button", { name: "Take a checkpoint" }).click();
    await page.getByRole("dialog").getByLabel("Token").fill(service.token);
    await page.keyboard.press("Enter");
    await page.getByText(/Done: a checkpoint is taken|Not now/).waitFor();
    assert.equal(tries, 2);
    await page.context().close();
  });
});
