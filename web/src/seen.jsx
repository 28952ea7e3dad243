// Parts that cost something are made anew only while they can be seen.

import { useEffect, useRef, useState } from "preact/hooks";

/** Whether an element is on the screen, or on paper. */
export function useSeen(again) {
  const place = useRef(null);
  const [is_seen, see] = useState(false);
  useEffect(() => {
    if (!place.current) return undefined;
    const seen = new IntersectionObserver(([entry]) => see(entry.isIntersecting), { rootMargin: "100px" });
    const print = () => see(true);
    seen.observe(place.current);
    addEventListener("beforeprint", print);
    return () => (seen.disconnect(), removeEventListener("beforeprint", print));
  }, [again]);
  return [place, is_seen];
}

/** What `children` makes, which stays as it was while nobody sees it, once it is something. */
export function Seen({ children }) {
  const [place, is_seen] = useSeen(true);
  const last = useRef(null);
  if (is_seen || !place.current?.firstChild) last.current = children();
  return <div ref={place}>{last.current}</div>;
}
