// Lines as strips of pixels: of each end, two vertices on both sides.
in vec3 position;
in vec3 other;
in float side;
in vec4 color;

uniform mat4 to_clip;
// Size of the picture in pixels, and half the lines' width.
uniform vec3 picture;
uniform float opacity;

out vec4 v_color;

void main() {
    vec4 here = to_clip * vec4(position, 1.0);
    vec4 there = to_clip * vec4(other, 1.0);
    // What is behind the eye moves along the line to before it.
    float near_here = here.z + here.w;
    float near_there = there.z + there.w;
    if (near_here < 0.0 && near_there > 0.0) {
        here = mix(here, there, near_here / (near_here - near_there));
    }
    if (near_there < 0.0 && near_here > 0.0) {
        there = mix(there, here, near_there / (near_there - near_here));
    }
    vec2 along = (there.xy / there.w - here.xy / here.w) * picture.xy;
    vec2 across = vec2(-along.y, along.x) / max(length(along), 1e-6);
    here.xy += across * side * picture.z * 2.0 / picture.xy * here.w;
    gl_Position = here;
    v_color = vec4(color.rgb, 1.0) * color.a * opacity;
}
