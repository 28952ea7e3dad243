// How the page looks: pictures at several widths, light and dark, printed; and what axe finds.

import assert from "node:assert/strict";
import { readFileSync, statSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { browser, driven, opened, pictures, text_of, until } from "./browser.mjs";
import { AXES, graph, serve } from "./service.mjs";

const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const WIDTHS = [360, 400, 1280, 2560, 3840];
const ENDS = [360, 3840];
/** What axe finds depends on light and dark, and little on widths. */
const EXAMINED = [400, 1280];
const SECTIONS = ["Now", "Drift", "Sources", "Sensors", "Graph", "Votes and novelty", "Swap", "Events"];

driven("how the page looks", () => {
  let service, chromium;
  before(async () => {
    [service, chromium] = await Promise.all([serve(), browser()]);
  });
  after(async () => {
    await chromium?.close();
    await service?.stop();
  });

  async function shown(width, colorScheme) {
    const page = await opened(chromium, service.url, { viewport: { width, height: Math.max(700, Math.round(width * 0.6)) }, colorScheme });
    await page.getByText("running", { exact: true }).waitFor();
    await page.getByRole("button", { name: "1 min" }).first().click();
    // All stands there, also for whoever has not scrolled to it.
    for (const name of [...SECTIONS, ...AXES]) await until(`${name} stands on it`, async () => (await text_of(page)).includes(name));
    for (const part of ["#graph", "#votes", "#drift"]) {
      await page.locator(part).evaluate((of) => of.scrollIntoView());
      await new Promise((done) => setTimeout(done, 400));
    }
    return page;
  }

  for (const width of WIDTHS) {
    test(`at ${width} px all stands on the page`, async (of) => {
      for (const scheme of ENDS.includes(width) ? ["light"] : ["light", "dark"]) {
        const page = await shown(width, scheme);
        const wide = await page.evaluate(() => document.documentElement.scrollWidth);
        assert.ok(wide <= width, `${wide} px of ${width}`);
        const drawn = await page.locator("canvas").evaluateAll((all) => all.map((canvas) => canvas.width));
        assert.ok(drawn.length >= 2 && drawn.every((size) => size > 150 && size <= width), `pictures of ${drawn} px`);
        const file = join(pictures, `${width}-${scheme}.png`);
        await page.screenshot({ path: file, fullPage: true });
        assert.ok(statSync(file).size > 30_000, `${file} shows something`);
        if (EXAMINED.includes(width)) assert.deepEqual(await examined(page), []);
        of.diagnostic(file);
        await page.context().close();
      }
    });
  }

  const ENDS = [360, 3840];
/** What axe finds serious or critical. Its script comes by the debugger, which a page's policy does not bind. */
  async function examined(page) {
    const session = await page.context().newCDPSession(page);
    const { result } = await session.send("Runtime.evaluate", { expression: `${axe};axe.run().then((of) => JSON.stringify(of.violations))`, awaitPromise: true, returnByValue: true });
    const grave = JSON.parse(result.value).filter((of) => ["serious", "critical"].includes(of.impact));
    return grave.map((of) => `${of.id}: ${of.nodes.map((node) => `${node.target.join(" ")} ${node.failureSummary}`).join("; ")}`);
  }

  test("the picture for whoever has not seen it yet", async () => {
    const page = await shown(1280, "light");
    await page.locator("header").evaluate((of) => of.scrollIntoView());
    await until("the newest curves", async () => /predicted\s+−?\d/.test(await page.locator(".legend").first().innerText()));
    await page.screenshot({ path: join(pictures, "page.png") });
    assert.deepEqual(page.wrong, []);
    await page.context().close();
  });

  test("a dialog, a refusal and a doubt are as readable", async (of) => {
    of.after(() => (service.feeding = true));
    const page = await opened(chromium, service.url);
    page.expected = () => true;
    await page.getByLabel("Graph or model").fill(graph().replace('"slope"', '"slop"'));
    await page.getByRole("button", { name: "Stage this graph" }).click();
    await page.getByRole("dialog").getByLabel("Token").fill(service.token);
    assert.deepEqual(await examined(page), []);
    await page.screenshot({ path: join(pictures, "dialog.png") });
    await page.keyboard.press("Enter");
    await page.locator(".refused").waitFor();
    service.feeding = false;
    await page.locator(".doubt").first().waitFor();
    assert.deepEqual(await examined(page), []);
    await page.screenshot({ path: join(pictures, "refused.png"), fullPage: true });
    await page.context().close();
  });

  test("it prints, on white, with all curves", async () => {
    const page = await shown(1280, "dark");
    const paper = await page.pdf({ format: "A4" });
    writeFileSync(join(pictures, "printed.pdf"), paper);
    assert.ok(paper.length > 20_000 && paper.length < 4_000_000, `${paper.length} bytes`);
    await page.emulateMedia({ media: "print" });
    await until("white paper", () => page.evaluate(() => getComputedStyle(document.body).backgroundColor === "rgb(255, 255, 255)"));
    assert.equal(await page.locator(".times:visible").count(), 0);
    await page.context().close();
  });

  test("keys alone reach each part", async () => {
    const page = await opened(chromium, service.url);
    await page.getByText("running", { exact: true }).waitFor();
    await page.locator("#votes").waitFor();
    const reached = new Set();
    for (let presses = 0; presses < 150; presses += 1) {
      await page.keyboard.press("Tab");
      reached.add(await page.evaluate(() => document.activeElement.closest("section")?.getAttribute("aria-labelledby") ?? document.activeElement.className));
    }
    for (const part of ["skip", "drift", "sensors", "votes", "swap", "events"]) assert.ok(reached.has(part), `${part} is reached: ${[...reached]}`);
    await page.context().close();
  });
});
