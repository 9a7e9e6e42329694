// One triangle over the whole picture.
uniform vec3 corner_direction;
uniform vec3 step_x;
uniform vec3 step_y;

out vec3 v_direction;
out vec2 v_place;

void main() {
    vec2 place = vec2(gl_VertexID == 1 ? 2.0 : 0.0, gl_VertexID == 2 ? 2.0 : 0.0);
    v_place = place;
    v_direction = corner_direction + step_x * place.x + step_y * (1.0 - place.y);
    gl_Position = vec4(place * 2.0 - 1.0, 1.0, 1.0);
}
