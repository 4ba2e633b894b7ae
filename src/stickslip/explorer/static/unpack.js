/* Arrays as the server packs them. */

const KINDS = { f4: Float32Array, i2: Int16Array, u1: Uint8Array };
export function unpacked({ dtype, bdata }) {
  return new KINDS[dtype](Uint8Array.from(atob(bdata), (c) => c.charCodeAt(0)).buffer);
}
