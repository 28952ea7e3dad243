// Debian's Chromium, and what no page may do in it: complain, or ask anybody else.

import { chromium } from "playwright-core";
import assert from "node:assert/strict";
import { existsSync, mkdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { describe, test } from "node:test";
import { athermal } from "./service.mjs";

const program = "/usr/bin/chromium";
const lacking = [!existsSync(program) && `${program} is not there`, !athermal && "ATHERMAL names no program"].filter(Boolean);
export const is_long = Boolean(process.env.ATHERMAL_LONG);
const FILES = { "/": ["index.html", "text/html; charset=utf-8"], "/page.js": ["page.js", "text/javascript; charset=utf-8"], "/page.css": ["page.css", "text/css; charset=utf-8"] };

/** Tests that need a browser and a service: skipped, with a remark, or failed where both have to be there. */
export function driven(name, tests) {
  if (lacking.length === 0) return describe(name, { timeout: is_long ? 1_200_000 : 120_000 }, tests);
  if (process.env.ATHERMAL_REQUIRE_SERVERS) return test(name, () => assert.fail(`${name}: ${lacking.join(", ")}`));
  console.log(`${name}: skipped, ${lacking.join(", ")}`);
  return undefined;
}

/** The folder of pictures. */
export const pictures = new URL("../../target/page/", import.meta.url).pathname;

export async function browser() {
  mkdirSync(pictures, { recursive: true });
  return chromium.launch({ executablePath: program, args: ["--no-sandbox"] });
}

/** A page of a service, and what it complained of and asked others for. */
export async function opened(of, url, { expected = () => false, ...options } = {}) {
  const context = await of.newContext({ viewport: { width: 1280, height: 900 }, ...options });
  const page = await context.newPage();
  const wrong = [];
  /** What is expected to fail, as while a connection is cut; of what fails on the way in, it stands before the page is opened. */
  page.expected = expected;
  page.on("console", (message) => ["error", "warning"].includes(message.type()) && !page.expected(message.text()) && wrong.push(`console: ${message.text()}`));
  page.on("pageerror", (error) => wrong.push(`error: ${error.message}`));
  page.on("request", (request) => {
    const to = request.url();
    if (!to.startsWith(url) && !to.startsWith("data:")) wrong.push(`asked ${to}`);
  });
  await bundle(page, url);
  await page.goto(url);
  page.wrong = wrong;
  return page;
}

/** Shows the files of ATHERMAL_DIST in place of those in the program, for whoever works on the page. */
export async function bundle(page, url) {
  const folder = process.env.ATHERMAL_DIST;
  if (!folder || url === "about:blank") return;
  const policy = (await page.request.get(url)).headers()["content-security-policy"] ?? "";
  for (const [path, [file, contentType]] of Object.entries(FILES)) {
    const headers = { "content-security-policy": policy };
    await page.route(new URL(path, url).href, (route) => route.fulfill({ body: readFileSync(join(folder, file)), contentType, headers }));
  }
}

/** Waits until something holds, for so many s. */
export async function until(what, holds, patience_s = 15) {
  const end = Date.now() + patience_s * 1000;
  let last;
  while (Date.now() < end) {
    last = await holds();
    if (last) return last;
    await new Promise((done) => setTimeout(done, 100));
  }
  return assert.fail(`not within ${patience_s} s: ${what}`);
}

/** All that a page shows as text. */
export const text_of = (page) => page.evaluate(() => document.body.innerText);
