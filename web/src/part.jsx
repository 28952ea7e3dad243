// A part that cannot be shown is named, and the others go on.

import { Component } from "preact";

/** How long it takes until it is tried again, in ms. */
const AGAIN_MS = 3000;

export class Part extends Component {
  componentDidCatch(error) {
    this.setState({ error });
    setTimeout(() => this.setState({ error: null }), AGAIN_MS);
  }

  render({ name, children }, { error }) {
    if (error) return <p class="bad">{name} cannot be shown: {error.message}; tried again.</p>;
    return children;
  }
}
